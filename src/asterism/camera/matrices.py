"""Matrices of a camera: construction, checks and decomposition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array, check_number, keep_array
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["checked_intrinsics", "checked_pose", "decomposed", "intrinsics", "looking_at"]

ROTATION_TOLERANCE = 1e-6


def intrinsics(
    *,
    focal_length: float,
    principal_point: tuple[float, float],
    pixels_per_metre: float | tuple[float, float] = 1.0,
    skew: float = 0.0,
) -> NDArray[np.float64]:
    """Multiply the two intrinsic matrices of the 2010 report (§3.1, 3.2), ``K' F``.

    Parameters
    ----------
    focal_length : float
        f in metres; or in pixels, with one pixel "per metre".
    principal_point : (u0, v0)
        Pixels from the centre of the top left one.
    pixels_per_metre : float or (k_u, k_v)
        On the sensor. The report calls them width and height of a pixel; they are the reciprocals.
    skew : float
        s_w, in the same unit as ``pixels_per_metre``.

    Returns
    -------
    ndarray, shape (3, 3)
        The matrix K of a `Camera`.

    Examples
    --------
    >>> intrinsics(focal_length=0.008, pixels_per_metre=1e5, principal_point=(639.5, 511.5))
    array([[800. ,   0. , 639.5],
           [  0. , 800. , 511.5],
           [  0. ,   0. ,   1. ]])
    """
    check_number("focal_length", focal_length, above=0)
    check_number("skew", skew)
    ku, kv = check_array("pixels_per_metre", np.broadcast_to(pixels_per_metre, 2), (2,))
    if ku <= 0 or kv <= 0:
        raise ParameterError("pixels_per_metre", "numbers > 0", pixels_per_metre)
    u0, v0 = check_array("principal_point", principal_point, (2,))
    f = focal_length
    return np.array([[f * ku, f * skew, u0], [0.0, f * kv, v0], [0.0, 0.0, 1.0]])


def checked_intrinsics(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return an intrinsic matrix, read-only, or raise a ParameterError."""
    K = keep_array(name, value, (3, 3))
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise ParameterError(
            name, "focal lengths > 0 on the diagonal", f"{K[0, 0]:g} and {K[1, 1]:g}"
        )
    if K[1, 0] != 0 or (K[2] != (0.0, 0.0, 1.0)).any():
        raise ParameterError(name, "[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]", K.tolist())
    return K


def checked_pose(value: ArrayLike) -> NDArray[np.float64]:
    """Return a world-to-camera matrix, read-only, or raise unless it is a rigid transformation."""
    T = keep_array("T_camera_world", value, (4, 4))
    R = T[:3, :3]
    if (T[3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise ParameterError("T_camera_world", "a last row of 0 0 0 1", T[3].tolist())
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    if off > ROTATION_TOLERANCE:
        raise ParameterError(
            "T_camera_world",
            "a rotation (R Rᵀ = 1)",
            f"R Rᵀ off by {off:.3g}",
            "is the matrix scaled?",
        )
    if np.linalg.det(R) < 0:
        raise ParameterError("T_camera_world", "a rotation", "a reflection (determinant -1)")
    return T


def looking_at(position: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """Return the world-to-camera matrix of a camera that looks at a target."""
    position, target, up = (
        check_array(name, value, (3,))
        for name, value in (("position", position), ("target", target), ("up", up))
    )
    z = target - position
    x = np.cross(z, up)
    if not np.linalg.norm(z) > 0:
        raise ParameterError("target", "another place than the camera's", target.tolist())
    if not np.linalg.norm(up) > 0:
        raise ParameterError("up", "a direction", up.tolist())
    if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(z) * np.linalg.norm(up):
        raise ParameterError("up", "not the direction of sight", up.tolist())
    z /= np.linalg.norm(z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z])
    T[:3, 3] = -T[:3, :3] @ position
    return T


def decomposed(P: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Decompose a projection matrix into K and world to camera; see `Camera.from_matrix`."""
    from scipy.linalg import rq

    matrix = check_array("P", P, (3, 4))
    if np.linalg.matrix_rank(matrix[:, :3]) < 3:
        raise ParameterError("P", "a regular left 3 × 3 part", "a singular one")
    matrix = matrix * np.sign(np.linalg.det(matrix[:, :3]))
    K, R = (np.asarray(m, dtype=np.float64) for m in rq(matrix[:, :3]))
    signs = np.sign(np.diag(K))
    K, R = K * signs, signs[:, None] * R
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = np.linalg.solve(K, matrix[:, 3])
    K = np.triu(K / K[2, 2])
    return K, T
