"""Conversion of a camera to the engine's object."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera.lens import Lens

__all__ = ["compile_camera", "middle_of_image"]


def compile_camera(
    *,
    K: NDArray[np.float64],
    lens_matrix: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    lens: Lens | None,
    near: float,
    far: float,
    size_px: tuple[int, int],
) -> _engine.Camera:
    """Return the engine's camera for the fields of a `Camera`.

    Parameters
    ----------
    K, T_camera_world, lens, near, far, size_px
        As for `Camera`.
    lens_matrix : ndarray of shape (3, 3)
        `Camera.lens_matrix`.

    Returns
    -------
    _engine.Camera
    """
    B = lens_matrix if lens is not None else K
    A = np.eye(3) if B is K else np.asarray(np.linalg.solve(B, K), np.float64)
    is_quadratic = lens is not None and lens.kind == "quadratic"
    start = middle_of_image(lens_matrix, size_px) if is_quadratic else np.zeros(2)
    return _engine.Camera(
        R=np.ascontiguousarray(T_camera_world[:3, :3]),
        t=np.ascontiguousarray(T_camera_world[:3, 3]),
        A=np.ascontiguousarray(A[:2]),
        B=np.ascontiguousarray(B[:2]),
        lens_kind=getattr(_engine.LensKind, "none" if lens is None else lens.kind),
        is_backward=lens is not None and lens.is_backward,
        coefficients=np.empty(0) if lens is None else lens.coefficients,
        r_end=float("inf") if lens is None else lens.radius,
        q_table=_table_extent(lens, lens_matrix, size_px),
        start=(float(start[0]), float(start[1])),
        near=near,
        far=far,
        width=size_px[0],
        height=size_px[1],
    )


def middle_of_image(
    lens_matrix: NDArray[np.float64], size_px: tuple[int, int]
) -> NDArray[np.float64]:
    """Return the centre of the image in lens coordinates.

    Parameters
    ----------
    lens_matrix : ndarray of shape (3, 3)
        Matrix between pixels and lens coordinates.
    size_px : (int, int)
        Width and height.

    Returns
    -------
    ndarray of shape (2,)
    """
    w, h = size_px
    middle = np.array([(w - 1) / 2, (h - 1) / 2, 1.0])
    return np.asarray(np.linalg.solve(lens_matrix, middle)[:2], dtype=np.float64)


def _table_extent(
    lens: Lens | None, lens_matrix: NDArray[np.float64], size_px: tuple[int, int]
) -> float:
    """Return the squared radius of the image in the coordinates that a radial lens maps from."""
    if lens is None or lens.kind == "quadratic":
        return 0.0
    w, h = size_px
    corners = np.array([[u, v, 1.0] for u in (-0.5, w - 0.5) for v in (-0.5, h - 0.5)])
    r = float(np.linalg.norm(np.linalg.solve(lens_matrix, corners.T)[:2], axis=0).max())
    if lens.is_backward:
        r = min(r, lens.radius)
        k = lens.coefficients
        r *= 1 + r**2 * (k[0] + r**2 * (k[1] + r**2 * k[2]))
    return r**2
