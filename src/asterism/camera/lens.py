"""Lens models: distortion of the ideal image, in the direction in which each model is defined.

A model maps undistorted to distorted coordinates (Brown-Conrady) or the reverse (all others). The
other direction is solved numerically to machine precision. Every model has a domain, the region
about the centre in which its derivative stretches by at least 0.01. Beyond it the polynomial folds
the image over, so points there are not seen.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import fields
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from asterism.checks import check_array, check_number
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["BrownConrady", "Lens", "QuadraticCorrection", "ReportRadial", "ViconRadial"]

MIN_STRETCH = 1e-2
"""Equal to kLeastStretch of engine/camera/lens.hpp."""


class Lens(ABC):
    """Lens model: `BrownConrady`, `ReportRadial`, `ViconRadial` or `QuadraticCorrection`.

    Examples
    --------
    >>> import asterism as am
    >>> lens = am.camera.ReportRadial(a1=-0.1)
    >>> lens.coefficients, round(lens.radius, 2)
    (array([-0.1,  0. ,  0. ,  0. ,  0. ]), 1.82)
    >>> isinstance(lens, am.camera.Lens)
    True
    """

    is_backward: ClassVar[bool] = True
    """Whether the model maps distorted to undistorted coordinates."""
    in_pixels: ClassVar[bool] = False
    """Whether the model uses pixels about the principal point, not normalised coordinates."""
    kind: ClassVar[Literal["radial", "quadratic"]] = "radial"
    """Equal to Lens::Kind of engine/camera/lens.hpp."""

    @property
    @abstractmethod
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients in the engine's order: k1, k2, k3, p1, p2, or ex and ey."""

    @property
    def radius(self) -> float:
        """Radius of the model's domain, in the coordinates from which it maps.

        It is infinite if the model never folds over. The derivative of radial and tangential terms
        is symmetric; the domain is the largest disc in which both its eigenvalues exceed 0.01.
        """
        k, p = self.coefficients[:3], float(np.hypot(*self.coefficients[3:]))
        # Coefficients without an effect within a billion pixels are left out.
        k = np.where(np.abs(k) * 1e18 ** np.arange(1, 4) < 1e-6, 0.0, k)
        return _end_of_disc(k, p if p > 1e-15 else 0.0)


@record(kw_only=False)
class BrownConrady(Lens):
    """Brown-Conrady model, undistorted to distorted, as in OpenCV.

    ``x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)``, and with x and y, p1 and p2
    exchanged for y_d; normalised coordinates.

    Parameters
    ----------
    k1, k2, p1, p2, k3 : float
        Radial (k) and tangential (p) coefficients in OpenCV's order, for normalised coordinates.

    References
    ----------
    D. C. Brown, Decentering distortion of lenses, Photogrammetric Engineering 32 (1966).

    Examples
    --------
    >>> lens = BrownConrady(k1=-0.3)
    >>> lens.coefficients
    array([-0.3,  0. ,  0. ,  0. ,  0. ])
    >>> round(lens.radius, 3)  # a little before the fold of r - 0.3 r³
    1.049
    """

    is_backward: ClassVar[bool] = False
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients ``(k1, k2, k3, p1, p2)``."""
        return np.array([self.k1, self.k2, self.k3, self.p1, self.p2])


@record(kw_only=False)
class ReportRadial(Lens):
    """Radial model of the 2010 report (§3.2), distorted to undistorted.

    ``x = x_d (1 + a1 r_d² + a2 r_d⁴)`` in normalised coordinates, so projecting solves for r_d.
    ``a1 > 0`` is barrel, ``a1 < 0`` pincushion distortion. Multiply coefficients for an image
    plane in metres by f² and f⁴.

    Parameters
    ----------
    a1, a2 : float
        Radial coefficients, for normalised coordinates.

    Examples
    --------
    >>> ReportRadial(a1=0.05).coefficients
    array([0.05, 0.  , 0.  , 0.  , 0.  ])
    """

    a1: float = 0.0
    a2: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients ``(a1, a2, 0, 0, 0)``."""
        return np.array([self.a1, self.a2, 0.0, 0.0, 0.0])


@record(kw_only=False)
class ViconRadial(Lens):
    """Vicon's radial model, measured to ideal pixels about the principal point.

    ``u - u0 = (u_d - u0) (1 + k1 r² + k2 r⁴ + k3 r⁶)`` with r in pixels. The camera's
    ``K_lens`` holds a distortion centre other than the principal point.

    Parameters
    ----------
    k1, k2, k3 : float
        Radial coefficients, px⁻², px⁻⁴ and px⁻⁶.

    Examples
    --------
    >>> ViconRadial(k1=4e-8, k2=1e-14).coefficients[:2]
    array([4.e-08, 1.e-14])
    """

    in_pixels: ClassVar[bool] = True
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        _check(self)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients ``(k1, k2, k3, 0, 0)``."""
        return np.array([self.k1, self.k2, self.k3, 0.0, 0.0])


@record(kw_only=False)
class QuadraticCorrection(Lens):
    """Quadratic correction of each axis, measured to ideal, as in MyPTV.

    ``x = u + ex · (u, v, u², v², u v)`` and ``y = v + ey · (u, v, u², v², u v)``.

    Parameters
    ----------
    ex, ey : sequence of 5 float
        Coefficients of each axis, for lens coordinates (`Camera.K_lens`).

    Examples
    --------
    >>> lens = QuadraticCorrection(ex=(0, 0, 1e-5, 0, 0), ey=(0, 0, 0, 1e-5, 0))
    >>> lens.coefficients[:5], lens.radius
    (array([0.e+00, 0.e+00, 1.e-05, 0.e+00, 0.e+00]), inf)
    >>> lens.reaches(100, 100), lens.reaches(-60_000, 100)
    (True, False)
    """

    kind: ClassVar[Literal["radial", "quadratic"]] = "quadratic"
    ex: tuple[float, float, float, float, float]
    ey: tuple[float, float, float, float, float]

    def __post_init__(self) -> None:
        for name in ("ex", "ey"):
            values = check_array(name, getattr(self, name), (5,))
            object.__setattr__(self, name, tuple(float(v) for v in values))

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients: five of ex, then five of ey."""
        return np.array([*self.ex, *self.ey])

    @property
    def radius(self) -> float:
        """Infinite, because the domain is not a disc; see `reaches`."""
        return float("inf")

    def reaches(self, u: float, v: float) -> bool:
        """Return whether a point is in the domain: the derivative's symmetric part exceeds 0.01.

        Parameters
        ----------
        u, v : float
            Point in lens coordinates.

        Returns
        -------
        bool
        """
        a, b = self.ex, self.ey
        xx = 1 + a[0] + 2 * a[2] * u + a[4] * v
        yy = 1 + b[1] + 2 * b[3] * v + b[4] * u
        xy = (a[1] + 2 * a[3] * v + a[4] * u + b[0] + 2 * b[2] * u + b[4] * v) / 2
        p, q = xx - MIN_STRETCH, yy - MIN_STRETCH
        return p > 0 and p * q > xy * xy


def _check(lens: BrownConrady | ReportRadial | ViconRadial) -> None:
    for field in fields(lens):
        value = getattr(lens, field.name)
        check_number(field.name, value)
        object.__setattr__(lens, field.name, float(value))


def _end_of_disc(k: NDArray[np.float64], p: float) -> float:
    """Return the radius within which the map's derivative has eigenvalues above the minimum.

    A and B are the stretch along and across the radius minus the minimum, and Q = p r. The
    determinant at angle φ to the tangential vector is
    ``(A + 6 Q cos φ)(B + 2 Q cos φ) - 4 Q² sin² φ``. Its minimum is at cos φ = -1, or in between
    if A + 3 B < 16 Q.
    """
    along = np.array([1 - MIN_STRETCH, -6 * p, 3 * k[0], 0, 5 * k[1], 0, 7 * k[2]])
    across = np.array([1 - MIN_STRETCH, -2 * p, k[0], 0, k[1], 0, k[2]])
    ends = [_first_root(along), _first_root(across)]
    if p > 0:

        def smallest_between(r: NDArray[np.float64]) -> NDArray[np.float64]:
            Q = p * r
            a = np.polynomial.polynomial.polyval(r, along) + 6 * Q
            b = np.polynomial.polynomial.polyval(r, across) + 2 * Q
            between = a * b - 4 * Q**2 - (a + 3 * b) ** 2 / 16
            return np.where(a + 3 * b < 16 * Q, between, a * b)

        radii = np.geomspace(1e-3 / p, 1e3 / p, 6001)
        radii = radii[radii < min(ends)]
        below = np.flatnonzero(smallest_between(radii) <= 0)
        if len(below):
            i = int(below[0])
            ends.append(_zero(smallest_between, radii[i - 1], radii[i]) if i else 0.0)
    return min(ends)


def _zero(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]], low: float, high: float
) -> float:
    from scipy.optimize import brentq

    def of_one(r: float) -> float:
        return float(function(np.array(r)))

    return float(brentq(of_one, low, high))  # pyright: ignore[reportArgumentType]


def _first_root(coefficients: NDArray[np.float64]) -> float:
    """Return the smallest positive root of a polynomial, given by ascending powers.

    The constant coefficient is positive. The result is infinite if there is no such root, or none
    within a factor of 1e10 of the smallest possible one.
    """
    powers = np.arange(1, len(coefficients))
    ratios = np.abs(coefficients[1:] / coefficients[0])
    powers, ratios = powers[ratios > 0], ratios[ratios > 0]
    if not len(powers):
        return float("inf")
    # In units of the smallest possible root no coefficient exceeds the constant one. The smallest
    # root is the largest inverse root, which is found most accurately.
    scale = float(np.exp(np.min(-np.log(ratios) / powers)))
    with np.errstate(under="ignore"):
        scaled = coefficients / coefficients[0] * scale ** np.arange(len(coefficients), dtype=float)
    scaled[np.abs(scaled) < 1e-40] = 0.0
    inverse = np.roots(np.trim_zeros(scaled, "b"))
    is_real = (np.abs(inverse.imag) <= 1e-7 * np.abs(inverse)) & (inverse.real > 0)
    largest = float(inverse.real[is_real].max(initial=0.0))
    return scale / largest if largest > 0 else float("inf")
