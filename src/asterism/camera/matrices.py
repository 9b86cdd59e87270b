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
        f in metres, > 0; or in pixels, with the default of `pixels_per_metre`.
    principal_point : (u0, v0)
        Pixels from the centre of the top left pixel.
    pixels_per_metre : float or (k_u, k_v)
        Density of the pixels on the sensor, > 0. The report calls these values the width and height
        of a pixel; they are the reciprocals.
    skew : float
        s_w, in the unit of `pixels_per_metre`; 0 for perpendicular axes.

    Returns
    -------
    ndarray of shape (3, 3)
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
    """Return an intrinsic matrix, read-only, or raise.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : array_like of shape (3, 3)
        ``[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]``, pixels.

    Returns
    -------
    ndarray of shape (3, 3)

    Raises
    ------
    ParameterError
        If the matrix has another form, or a focal length is not positive.

    Examples
    --------
    >>> checked_intrinsics("K", [[800, 0, 640], [0, 0, 512], [0, 0, 1]])
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: K: expected focal lengths > 0 on the diagonal, found 800 and 0
    """
    K = keep_array(name, value, (3, 3))
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise ParameterError(
            name, "focal lengths > 0 on the diagonal", f"{K[0, 0]:g} and {K[1, 1]:g}"
        )
    if K[1, 0] != 0 or (K[2] != (0.0, 0.0, 1.0)).any():
        raise ParameterError(name, "[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]", K.tolist())
    return K


def checked_pose(value: ArrayLike) -> NDArray[np.float64]:
    """Return a world-to-camera matrix, read-only, or raise.

    Parameters
    ----------
    value : array_like of shape (4, 4)
        Rotation and translation, metres.

    Returns
    -------
    ndarray of shape (4, 4)

    Raises
    ------
    ParameterError
        If the matrix is not a rigid transformation.

    Examples
    --------
    >>> checked_pose(2 * np.eye(4))
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: T_camera_world: expected a last row of 0 0 0 1, found [0.0,
    0.0, 0.0, 2.0]
    """
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
            "divide the matrix by its scale",
        )
    if np.linalg.det(R) < 0:
        raise ParameterError("T_camera_world", "a rotation", "a reflection (determinant -1)")
    return T


def looking_at(position: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """Return the world-to-camera matrix of a camera that looks at a target.

    Parameters
    ----------
    position, target : array_like of shape (3,)
        World metres.
    up : array_like of shape (3,)
        World direction that is up in the image.

    Returns
    -------
    ndarray of shape (4, 4)

    Raises
    ------
    ParameterError
        If position and target coincide, or `up` is the direction of sight.

    Examples
    --------
    >>> T = looking_at((0, -4, 1), (0, 0, 1), up=(0, 0, 1))
    >>> T @ (0, 0, 1, 1)  # the target lies on the optical axis, 4 m ahead
    array([0., 0., 4., 1.])
    """
    position, target, up = (
        check_array(name, value, (3,))
        for name, value in (("position", position), ("target", target), ("up", up))
    )
    z = target - position
    x = np.cross(z, up)
    if not np.linalg.norm(z) > 0:
        raise ParameterError("target", "a position other than the camera's", target.tolist())
    if not np.linalg.norm(up) > 0:
        raise ParameterError("up", "a direction", up.tolist())
    if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(z) * np.linalg.norm(up):
        raise ParameterError("up", "another direction than that of sight", up.tolist())
    z /= np.linalg.norm(z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z])
    T[:3, 3] = -T[:3, :3] @ position
    return T


def decomposed(P: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Decompose a projection matrix into an intrinsic matrix and a pose.

    Parameters
    ----------
    P : array_like of shape (3, 4)
        Projection matrix, up to scale and sign.

    Returns
    -------
    K : ndarray of shape (3, 3)
    T_camera_world : ndarray of shape (4, 4)

    Raises
    ------
    ParameterError
        If the left 3 × 3 part is singular.

    References
    ----------
    R. Hartley, A. Zisserman, Multiple View Geometry (2004), §6.2.4.

    Examples
    --------
    >>> K = intrinsics(focal_length=800, principal_point=(639.5, 511.5))
    >>> T = looking_at((0, -4, 1), (0, 0, 1), up=(0, 0, 1))
    >>> found_K, found_T = decomposed(-2 * K @ T[:3])
    >>> bool(np.allclose(found_K, K) and np.allclose(found_T, T))
    True
    """
    from scipy.linalg import rq

    matrix = check_array("P", P, (3, 4))
    if np.linalg.matrix_rank(matrix[:, :3]) < 3:
        raise ParameterError("P", "a left 3 × 3 part of rank 3", "a singular one")
    matrix = matrix * np.sign(np.linalg.det(matrix[:, :3]))
    K, R = (np.asarray(m, dtype=np.float64) for m in rq(matrix[:, :3]))
    signs = np.sign(np.diag(K))
    K, R = K * signs, signs[:, None] * R
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = np.linalg.solve(K, matrix[:, 3])
    K = np.triu(K / K[2, 2])
    return K, T
