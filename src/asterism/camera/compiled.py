"""A camera as the engine has it: matrices and a lens, ready to be used point by point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.camera.lens import NO_LENS, QUADRATIC

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera.camera import Camera

__all__ = ["compile_camera", "middle_of_image"]


def compile_camera(camera: Camera) -> _engine.Camera:
    """Give what the engine needs of a camera."""
    lens = camera.lens
    B = camera.lens_matrix if lens is not None else camera.K
    A = np.eye(3) if B is camera.K else np.asarray(np.linalg.solve(B, camera.K), np.float64)
    is_quadratic = lens is not None and lens.kind == QUADRATIC
    start = middle_of_image(camera) if is_quadratic else np.zeros(2)
    return _engine.Camera(
        R=np.ascontiguousarray(camera.T_camera_world[:3, :3]),
        t=np.ascontiguousarray(camera.T_camera_world[:3, 3]),
        A=np.ascontiguousarray(A[:2]),
        B=np.ascontiguousarray(B[:2]),
        lens_kind=NO_LENS if lens is None else lens.kind,
        is_backward=lens is not None and lens.is_backward,
        coefficients=np.empty(0) if lens is None else lens.coefficients,
        r_end=float("inf") if lens is None else lens.radius,
        q_table=_table_extent(camera),
        start=(float(start[0]), float(start[1])),
        near=camera.near,
        far=camera.far,
        width=camera.size_px[0],
        height=camera.size_px[1],
    )


def middle_of_image(camera: Camera) -> NDArray[np.float64]:
    """Give the centre of the image in lens coordinates, shape (2,)."""
    w, h = camera.size_px
    middle = np.array([(w - 1) / 2, (h - 1) / 2, 1.0])
    return np.asarray(np.linalg.solve(camera.lens_matrix, middle)[:2], dtype=np.float64)


def _table_extent(camera: Camera) -> float:
    """Give the squared radius of the image in the coordinates that a radial lens is solved from."""
    lens = camera.lens
    if lens is None or lens.kind == QUADRATIC:
        return 0.0
    w, h = camera.size_px
    corners = np.array([[u, v, 1.0] for u in (-0.5, w - 0.5) for v in (-0.5, h - 0.5)])
    r = float(np.linalg.norm(np.linalg.solve(camera.lens_matrix, corners.T)[:2], axis=0).max())
    if lens.is_backward:
        r = min(r, lens.radius)
        k = lens.coefficients
        r *= 1 + r**2 * (k[0] + r**2 * (k[1] + r**2 * k[2]))
    return r**2
