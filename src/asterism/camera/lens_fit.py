"""Conversion between lens models by a fit, with the residuals."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera.lens import BrownConrady, QuadraticCorrection, ReportRadial, ViconRadial
from asterism.checks import check_fields
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    from asterism.camera.camera import Camera
    from asterism.camera.lens import Lens

__all__ = ["LensFit", "fit_lens"]

FITTED, JUDGED = 31, 151
"""Number of pixels along the longer image side at which lenses are fitted and compared."""

FEWEST = 25
"""Smallest number of fitted pixels in the domain of the old lens."""

_POWERS = {"k1": 2, "k2": 4, "k3": 6, "a1": 2, "a2": 4, "p1": 1, "p2": 1}
"""Power of the radius of each coefficient, beyond the first."""


@record
class LensFit:
    """Result of `fit_lens`: the camera with the new lens, and its deviation from the old one.

    Parameters
    ----------
    camera : Camera
        Camera with the fitted lens.
    rms_px, max_px : float
        Root mean square and largest distance between the pixels of the two cameras for the same
        ray, over the image. A ray that the new lens does not reach counts with the image width.

    Examples
    --------
    >>> import asterism as am
    >>> lens = am.camera.BrownConrady(k1=-0.1)
    >>> camera = am.Rig.ring(1, radius=4, height=2, lens=lens)[0]
    >>> fit = am.camera.fit_lens(camera, None)  # a pin-hole without distortion
    >>> fit.camera.lens, fit.max_px > 10
    (None, True)
    """

    camera: Camera
    rms_px: float
    max_px: float


def fit_lens(
    camera: Camera,
    kind: type[Lens] | None,
    *,
    refit_camera: bool = False,
    without: Collection[str] = (),
) -> LensFit:
    """Fit another lens model to a camera over its image.

    There is no exact conversion: the models map in different directions, and an inverted sign is
    correct to first order only. The new model is therefore fitted, and its deviation reported.

    Parameters
    ----------
    camera : Camera
        Camera whose lens is replaced.
    kind : type of Lens or None
        `BrownConrady`, `ReportRadial`, `ViconRadial`, None for a pin-hole, or
        `QuadraticCorrection`. The last applies to raw pixels and may shift the principal point.
    refit_camera : bool
        Whether K and the direction of the camera may change too, for a better fit; the position
        never does. Useful for a camera with a `K_lens` or a skew that the result does not have.
    without : collection of str
        Coefficients that stay 0, such as "k3" or "skew".

    Returns
    -------
    LensFit
        Camera with the new lens, and its deviation in pixels.

    Raises
    ------
    ParameterError
        If the kind is unknown, or the old lens reaches less than 25 of the fitted pixels.

    Examples
    --------
    >>> import asterism as am
    >>> lens = am.camera.BrownConrady(k1=-0.1)
    >>> camera = am.Rig.ring(1, radius=4, height=2, lens=lens)[0]
    >>> fit = am.camera.fit_lens(camera, am.camera.ReportRadial)
    >>> round(fit.camera.lens.a1, 2), round(fit.rms_px, 1), round(fit.max_px, 1)
    (0.09, 0.1, 1.1)
    """
    from scipy.optimize import least_squares

    if kind not in (BrownConrady, ReportRadial, ViconRadial, QuadraticCorrection, None):
        expected = "BrownConrady, ReportRadial, ViconRadial, QuadraticCorrection or None"
        raise ParameterError("kind", expected, kind)
    check_fields("without", without, ("skew", *_POWERS))
    pixels, rays = _image(camera, FITTED)
    if len(pixels) < FEWEST:
        expected = f"a lens that reaches at least {FEWEST} pixels of the grid"
        raise ParameterError(f"camera {camera.name!r}", expected, camera.lens)
    if kind is QuadraticCorrection:
        return _judged(camera, _quadratic(camera, pixels, rays))
    free = _Free(camera, kind, refit_camera, without, rays)
    start = free.first_guess(pixels, rays)

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return _apart(camera, free.camera(x), pixels, rays).ravel()

    fitted = start
    if len(start):
        fitted = np.asarray(least_squares(residual, start, x_scale="jac", xtol=1e-10, ftol=1e-10).x)
    # A lens without distortion may be better if no other one reaches the corners.
    tries = (fitted, np.zeros(len(start)))
    best = tries[int(np.argmin([np.sum(residual(x) ** 2) for x in tries]))]
    return _judged(camera, free.camera(best))


def _image(camera: Camera, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a grid of pixels in the domain of the lens, and their normalised coordinates."""
    w, h = camera.size_px
    step = max((max(w, h) - 1) / (n - 1), 1e-9)
    across, down = (
        np.linspace(0, side - 1, max(2, round((side - 1) / step) + 1)) for side in (w, h)
    )
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = camera.undistort(pixels)
    is_reached = np.isfinite(rays).all(axis=1)
    return pixels[is_reached], rays[is_reached]


def _apart(
    old: Camera, new: Camera, pixels: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the pixels of the rays in the new camera minus those in the old one, (n, 2)."""
    turned = np.column_stack([rays, np.ones(len(rays))]) @ (
        old.T_camera_world[:3, :3] @ new.T_camera_world[:3, :3].T
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = new.distort(turned[:, :2] / turned[:, 2:])
    return np.nan_to_num(seen - pixels, nan=float(max(old.size_px)) / np.sqrt(2))


def _judged(old: Camera, new: Camera) -> LensFit:
    distance = np.linalg.norm(_apart(old, new, *_image(old, JUDGED)), axis=1)
    return LensFit(
        camera=new,
        rms_px=float(np.sqrt(np.mean(distance**2))),
        max_px=float(distance.max()),
    )


def _quadratic(camera: Camera, pixels: NDArray[np.float64], rays: NDArray[np.float64]) -> Camera:
    """Fit a correction of raw pixels, which is linear in all its unknowns."""
    u, v = pixels.T
    size = float(max(camera.size_px))
    scale = np.array([size, size, size**2, size**2, size**2, 1.0])
    terms = np.stack([u, v, u * u, v * v, u * v, np.ones(len(u))], axis=1) / scale
    ideal = rays @ camera.K[:2, :2].T + camera.K[:2, 2]
    solved = np.linalg.lstsq(terms, ideal - pixels)[0].T / scale
    K = camera.K.copy()
    K[:2, 2] -= solved[:, 5]
    ex, ey = ((float(a), float(b), float(c), float(d), float(e)) for a, b, c, d, e, _ in solved)
    return camera.replace(K=K, K_lens=np.eye(3), lens=QuadraticCorrection(ex=ex, ey=ey))


class _Free:
    """Free parameters of the fit: the coefficients, and on request K and the direction.

    A coefficient is scaled by its effect at the corner of the image, so that all have similar
    sizes. The logarithms of the focal lengths, the principal point and the skew in focal lengths,
    and a rotation vector follow.
    """

    def __init__(
        self,
        camera: Camera,
        kind: type[Lens] | None,
        refit: bool,
        without: Collection[str],
        rays: NDArray[np.float64],
    ) -> None:
        self.old, self.kind = camera, kind
        self.names: list[str] = []
        if kind is not None:
            self.names = [field.name for field in fields(kind)]  # pyright: ignore[reportArgumentType]
        self.names = [name for name in self.names if name not in without]
        radius = float(np.linalg.norm(rays, axis=1).max())
        if kind is not None and kind.in_pixels:
            radius *= float(camera.K[0, 0])
        self.scale = np.array([radius ** -_POWERS[name] for name in self.names])
        self.K = camera.K.copy()
        if "skew" in without:
            self.K[0, 1] = 0.0
        # Free entries of K, and the number of free parameters besides the coefficients.
        self.moving = ([0, 1], [2, 2]) if "skew" in without else ([0, 1, 0], [2, 2, 1])
        self.n_camera = 2 + len(self.moving[0]) + 3 if refit else 0

    def first_guess(
        self, pixels: NDArray[np.float64], rays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Solve for the coefficients in lens coordinates, in which every model is linear."""
        if self.kind is None:
            return np.zeros(self.n_camera)
        matrix = self.old.replace(K=self.K, K_lens=None, lens=self.kind()).lens_matrix
        bent, ideal = (
            (np.column_stack([p, np.ones(len(p))]) @ np.linalg.solve(matrix, M).T)[:, :2]
            for p, M in ((pixels, np.eye(3)), (rays, self.K))
        )
        source, target = (bent, ideal) if self.kind.is_backward else (ideal, bent)
        x, y = source.T
        q = x**2 + y**2
        basis: list[NDArray[np.float64]] = []
        for name, scale in zip(self.names, self.scale, strict=True):
            if name == "p1":
                column = np.stack([2 * x * y, q + 2 * y**2], axis=1)
            elif name == "p2":
                column = np.stack([q + 2 * x**2, 2 * x * y], axis=1)
            else:
                column = source * (q ** (_POWERS[name] / 2))[:, None]
            basis.append(scale * column.ravel())
        solved = np.linalg.lstsq(np.stack(basis, axis=1), (target - source).ravel())[0]
        return np.concatenate([solved, np.zeros(self.n_camera)]).astype(np.float64)

    def camera(self, x: NDArray[np.float64]) -> Camera:
        from scipy.spatial.transform import Rotation

        n = len(self.names)
        values = (float(v) for v in x[:n] * self.scale)
        coefficients: dict[str, Any] = dict(zip(self.names, values, strict=True))
        K, T = self.K.copy(), self.old.T_camera_world
        if self.n_camera:
            K[[0, 1], [0, 1]] *= np.exp(np.clip(x[n : n + 2], -5, 5))
            K[self.moving] += x[n + 2 : -3] * self.K[0, 0]
            T = T.copy()
            T[:3] = Rotation.from_rotvec(x[-3:]).as_matrix() @ T[:3]
        lens = None if self.kind is None else self.kind(**coefficients)
        return self.old.replace(K=K, T_camera_world=T, K_lens=None, lens=lens)
