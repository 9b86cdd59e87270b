"""Triangulation of points: linear start, Gauss-Newton on pixels, covariance.

The matches are given here; `asterism.multiview.correspondence` finds them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_array, check_kind
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Triangulation", "per_camera", "triangulate"]

_ROUNDS = 20
_MIN_STEP = 1e-9  # share of a point's distance; the step after a smaller one is rounding
_FLATTEST = 1e12  # largest condition of the information, as in `Rig.coverage`


@record(eq=False)
class Triangulation:
    """Result of `triangulate`: points in space with their covariances and residuals.

    Attributes
    ----------
    points : ndarray of shape (N, 3)
        World metres; NaN for a point that fewer than two cameras see, or that would lie behind one.
    covariances : ndarray of shape (N, 3, 3)
        Covariance of each point, m²: the inverse of the summed information ``Jᵀ J / σ²`` (the
        Cramér-Rao bound). NaN for points that are NaN, or whose rays lie on one line.
    residuals : ndarray of shape (C, N, 2)
        Measured pixel minus projected pixel; NaN without a measurement.
    n_views : ndarray of int, shape (N,)
        Number of cameras that see each point.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(3, radius=4, height=2)
    >>> found = am.multiview.triangulate(rig.project([[0.1, 0.2, 1.0]]).pixels, rig)
    >>> np.sqrt(np.diag(found.covariances[0])).round(4)  # standard deviations, metres
    array([0.0011, 0.0011, 0.0008])
    >>> float(np.abs(found.residuals).max()) < 1e-6
    True
    """

    points: NDArray[np.float64]
    covariances: NDArray[np.float64]
    residuals: NDArray[np.float64]
    n_views: NDArray[np.int64]


def triangulate(
    pixels: ArrayLike, rig: Rig, *, sigma_px: ArrayLike = 0.3, start: ArrayLike | None = None
) -> Triangulation:
    """Triangulate points by minimising their squared reprojection errors.

    The linear start is the position nearest to all rays. Gauss-Newton steps through the lens then
    minimise ``Σ_c |z_c - h_c(X)|² / σ_c²``; a step that would increase it is damped.

    Parameters
    ----------
    pixels : array_like of shape (C, N, 2)
        Image point of each point in each camera; NaN if the camera has none.
    rig : Rig
        The C cameras.
    sigma_px : array_like of shape (), (C,) or (C, N)
        Standard deviation of an image point, pixels per axis, > 0: one for all, one for each
        camera, or one for each image point. It weights the cameras and scales the covariances.
    start : array_like of shape (N, 3), optional
        Initial positions instead of the linear start, world metres.

    Returns
    -------
    Triangulation
        Points with covariances and residuals.

    Raises
    ------
    ParameterError
        If the arrays do not fit the rig.

    References
    ----------
    R. Hartley, A. Zisserman, Multiple View Geometry (2004), §12.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(3, radius=4, height=2)
    >>> seen = rig.project([[0.1, 0.2, 1.0]]).pixels
    >>> found = am.multiview.triangulate(seen, rig)
    >>> found.points.round(9), found.n_views
    (array([[0.1, 0.2, 1. ]]), array([3]))
    """
    z = check_array("pixels", pixels, (len(_checked(rig)), "N", 2), finite=False)
    if np.isinf(z).any():
        raise ParameterError(
            "pixels", "finite numbers, or NaN without an image point", "infinities"
        )
    if np.ndim(sigma_px) == 2:
        sigma = check_array("sigma_px", sigma_px, z.shape[:2])
        if (sigma <= 0).any():
            raise ParameterError("sigma_px", "numbers > 0", float(sigma.min()))
    else:
        sigma = per_camera("sigma_px", sigma_px, rig)[:, None]
    rays = np.stack([camera.rays(p) for camera, p in zip(rig, z, strict=True)])
    is_seen = np.isfinite(rays[..., 0])
    n_views = is_seen.sum(axis=0)
    if start is None:
        points = _nearest_to_rays(rig, rays, is_seen)
    else:
        points = check_array("start", start, (z.shape[1], 3), finite=False).copy()
    points[n_views < 2] = np.nan
    weights = np.where(is_seen, sigma**-2.0, 0.0)
    points = _descended(points, z, weights, rig)
    points[~np.isfinite(_cost(points, z, weights, rig))] = np.nan
    information, _ = _normal_equations(points, z, weights, rig)
    covariances = np.full(information.shape, np.nan)
    known = np.flatnonzero(np.isfinite(points[:, 0]))
    is_known = known[np.linalg.cond(information[known]) < _FLATTEST]
    covariances[is_known] = np.linalg.inv(information[is_known])
    residuals = np.where(is_seen[..., None], z - rig.project(points).pixels, np.nan)
    return Triangulation(
        points=points, covariances=covariances, residuals=residuals, n_views=n_views
    )


def per_camera(
    name: str, value: ArrayLike, rig: Rig, *, below: float = np.inf, closed: bool = False
) -> NDArray[np.float64]:
    """Return a number for each camera, from one number or from one for each.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : array_like of shape () or (C,)
        The number or numbers.
    rig : Rig
        The C cameras.
    below : float
        Upper bound, excluded.
    closed : bool
        Whether 0 is allowed.

    Returns
    -------
    ndarray of shape (C,)

    Raises
    ------
    ParameterError
        If a number is out of range, or there is another number of them.

    Examples
    --------
    >>> import asterism as am
    >>> per_camera("sigma_px", 0.3, am.Rig.ring(3, radius=4, height=2))
    array([0.3, 0.3, 0.3])
    """
    numbers = np.asarray(value)
    if numbers.ndim == 0:
        numbers = np.full(len(rig), numbers)
    numbers = check_array(name, numbers, (len(rig),))
    is_low = (numbers < 0) if closed else (numbers <= 0)
    if is_low.any() or (numbers >= below).any():
        expected = f"numbers {'≥' if closed else '>'} 0"
        expected += f" and < {below:g}" if np.isfinite(below) else ""
        raise ParameterError(name, expected, numbers.tolist())
    return numbers


def _checked(rig: Rig) -> Rig:
    check_kind("rig", rig, Rig, "am.read_rig(path)")
    return rig


def _nearest_to_rays(
    rig: Rig, rays: NDArray[np.float64], is_seen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the points with the smallest sum of squared distances to their rays, (N, 3)."""
    N = rays.shape[1]
    A, b = np.zeros((N, 3, 3)), np.zeros((N, 3))
    for camera, d, seen in zip(rig, rays, is_seen, strict=True):
        across = np.eye(3) - d[seen, :, None] * d[seen, None, :]
        A[seen] += across
        b[seen] += across @ camera.center
    points = np.full((N, 3), np.nan)
    is_known = is_seen.sum(axis=0) >= 2
    is_known[is_known] = np.linalg.cond(A[is_known]) < _FLATTEST
    points[is_known] = np.linalg.solve(A[is_known], b[is_known, :, None])[..., 0]
    return points


def _descended(
    points: NDArray[np.float64], z: NDArray[np.float64], weights: NDArray[np.float64], rig: Rig
) -> NDArray[np.float64]:
    """Minimise the cost of each point until its steps are below rounding."""
    points = points.copy()
    reach = np.stack([np.linalg.norm(points - camera.center, axis=1) for camera in rig]).max(axis=0)
    damping = np.zeros(len(points))
    cost = _cost(points, z, weights, rig)
    active = np.flatnonzero(np.isfinite(cost))  # NaN stays NaN
    for _ in range(_ROUNDS):
        if not len(active):
            break
        A, g = _normal_equations(points[active], z[:, active], weights[:, active], rig)
        diagonal = np.trace(A, axis1=1, axis2=2) / 3
        # The damping of 1e-13 keeps directions that no ray determines (rays on one line).
        A += ((damping[active] + 1e-13) * diagonal)[:, None, None] * np.eye(3)
        step = np.linalg.solve(A, g[..., None])[..., 0]
        there = points[active] + step
        new = _cost(there, z[:, active], weights[:, active], rig)
        descends = new <= cost[active]
        chosen = active[descends]
        points[chosen], cost[chosen] = there[descends], new[descends]
        damping[chosen] /= 10
        damping[active[~descends]] = np.maximum(10 * damping[active[~descends]], 1e-3)
        is_large = np.linalg.norm(step, axis=1) > _MIN_STEP * reach[active]
        active = active[is_large]
    return points


def _cost(
    points: NDArray[np.float64], z: NDArray[np.float64], weights: NDArray[np.float64], rig: Rig
) -> NDArray[np.float64]:
    """Return the weighted sum of squares, pixels; infinite if a camera cannot see a point."""
    off = ((z - rig.project(points).pixels) ** 2).sum(axis=-1) * weights
    cost = np.where(weights > 0, off, 0.0).sum(axis=0)
    return np.where(np.isfinite(cost) & np.isfinite(points[:, 0]), cost, np.inf)


def _normal_equations(
    points: NDArray[np.float64], z: NDArray[np.float64], weights: NDArray[np.float64], rig: Rig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the information ``Σ w Jᵀ J`` (N, 3, 3) and gradient ``Σ w Jᵀ (z - h)`` (N, 3)."""
    A, g = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
    projected = rig.project(points).pixels
    for camera, seen_at, h, w in zip(rig, z, projected, weights, strict=True):
        seen = (w > 0) & np.isfinite(h[:, 0])
        J = camera.jacobian(points[seen])
        scaled = np.swapaxes(J, 1, 2) * w[seen, None, None]
        A[seen] += scaled @ J
        g[seen] += (scaled @ (seen_at[seen] - h[seen])[..., None])[..., 0]
    return A, g
