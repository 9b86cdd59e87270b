"""Cameras of the player: a pinhole, and a table of the displacements by the lens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Camera

__all__ = ["camera_header", "lens_table", "pixels_by"]

SIDE = 41
"""Number of nodes of the table along each side; it is interpolated between them."""
_WITHOUT = np.float32(np.nan)


def camera_header(camera: Camera, number: int) -> dict[str, Any]:
    """Return the parameters of a camera for the player, without its lens."""
    width, height = camera.size_px
    right, low = width - 0.5, height - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [right, low], [-0.5, low]])
    rays = camera.rays(corners)
    if not np.isfinite(rays).all():  # undefined lens at the corners: pinhole
        sight = np.concatenate([corners, np.ones((4, 1))], axis=1) @ np.linalg.inv(camera.K).T
        rays = sight / np.linalg.norm(sight, axis=1, keepdims=True) @ camera.T_camera_world[:3, :3]
    return {
        "name": camera.name or str(number + 1),
        "size": [width, height],
        "K": [round(float(x), 6) for x in camera.K[:2].ravel()],
        "T": [round(float(x), 9) for x in camera.T_camera_world[:3].ravel()],
        "near": camera.near,
        "far": camera.far if np.isfinite(camera.far) else None,
        "centre": [round(float(x), 6) for x in camera.center],
        "corners": [[round(float(x), 6) for x in ray] for ray in rays],
    }


def lens_table(camera: Camera) -> tuple[NDArray[np.float32], list[float], float]:
    """Tabulate the displacements by a lens relative to a pinhole.

    Parameters
    ----------
    camera : Camera
        Camera with any lens, or without one.

    Returns
    -------
    table : ndarray of shape (SIDE, SIDE, 2)
        Pixels, over even steps of ``y = Y / Z`` and then ``x = X / Z``; NaN where the lens is not
        defined. Empty without a lens.
    range : list of float
        Lowest and highest x, lowest and highest y; empty without a lens.
    error : float
        Largest error of the interpolated table in the image, pixels.
    """
    if camera.lens is None:
        return np.empty((0, 0, 2), np.float32), [], 0.0
    width, height = camera.size_px
    u, v = np.meshgrid(np.linspace(-0.5, width - 0.5, 81), np.linspace(-0.5, height - 0.5, 81))
    image = np.stack([u, v], axis=-1).reshape(-1, 2)
    seen = camera.undistort(image)
    inside = np.isfinite(seen).all(axis=1)
    if not inside.any():
        return np.full((SIDE, SIDE, 2), _WITHOUT), [-1.0, 1.0, -1.0, 1.0], 0.0
    low, high = seen[inside].min(axis=0), seen[inside].max(axis=0)
    room = 0.02 * (high - low)
    low, high = low - room, high + room
    x, y = np.meshgrid(*(np.linspace(low[i], high[i], SIDE) for i in range(2)))
    places = np.stack([x, y], axis=-1)
    table = (camera.distort(places) - _pinhole(camera, places)).astype(np.float32)
    bounds = [float(b) for b in (low[0], high[0], low[1], high[1])]
    off = np.linalg.norm(pixels_by(camera, table, bounds, seen[inside]) - image[inside], axis=1)
    return table, bounds, float(np.nanmax(off, initial=0.0))


def pixels_by(
    camera: Camera, table: NDArray[np.float32], bounds: list[float], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return pixels as in the player: pinhole projection and bilinear table of the lens.

    Parameters
    ----------
    camera : Camera
        Camera of the table.
    table : ndarray of shape (SIDE, SIDE, 2)
        Table of `lens_table`.
    bounds : list of float
        Range of `lens_table`.
    places : ndarray of shape (N, 2)
        Points ``(X / Z, Y / Z)`` within the bounds.

    Returns
    -------
    ndarray of shape (N, 2)
        Pixels (u, v).
    """
    low, high = np.array(bounds[::2]), np.array(bounds[1::2])
    at = (places - low) / (high - low) * (SIDE - 1)
    i = np.clip(at.astype(np.int64), 0, SIDE - 2)
    (fx, fy), (ix, iy) = (at - i).T, i.T
    fx, fy = fx[:, None], fy[:, None]
    upper = (1 - fx) * table[iy, ix] + fx * table[iy, ix + 1]
    lower = (1 - fx) * table[iy + 1, ix] + fx * table[iy + 1, ix + 1]
    return _pinhole(camera, places) + (1 - fy) * upper + fy * lower


def _pinhole(camera: Camera, places: NDArray[np.float64]) -> NDArray[np.float64]:
    return places @ camera.K[:2, :2].T + camera.K[:2, 2]
