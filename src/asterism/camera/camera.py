"""One camera: a pin-hole, a lens, a place in the world, an image of a certain size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from scipy.linalg import rq

from asterism import _engine
from asterism.camera.lens import NO_LENS, QUADRATIC, Lens, QuadraticCorrection
from asterism.camera.projection import Projection
from asterism.camera.surfaces import compile_surfaces
from asterism.errors import ParameterError, check_array, check_number, keep_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera.surfaces import Surface

__all__ = ["CLEARANCE", "Camera", "intrinsics", "project_points"]

CLEARANCE = 1e-6
"""Metres before a point in which a surface does not hide it: a marker may lie on its surface."""

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


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A camera that can be trusted to the last digit.

    A point goes to camera coordinates by ``T_camera_world``, to ``(x, y) = (X / Z, Y / Z)``,
    through the lens, and to the pixel ``K (x, y, 1)``. The camera looks along +z; pixels count from
    the centre of the top left one, u to the right, v down: the image spans -0.5 to width - 0.5.

    Parameters
    ----------
    K : array_like, shape (3, 3)
        ``[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]``, pixels; s is the skew.
    T_camera_world : array_like, shape (4, 4)
        Takes world to camera coordinates, metres; a rotation and a shift.
    size_px : (int, int)
        Width and height of the image.
    lens : Lens, optional
        How the image is bent; None for a pin-hole.
    K_lens : array_like, shape (3, 3), optional
        Where a calibration keeps them apart, the matrix between pixels and the coordinates in which
        the lens works: an ideal pixel p becomes ``K_lens distort(K_lens⁻¹ p)``. By default K, or
        for a lens in pixels the shift to the principal point.
    near, far : float
        Range of depths along the optical axis in which points are seen, metres.
    name : str
        For people and files.

    Raises
    ------
    ParameterError
        If a matrix is singular, not finite or not of its form, the rotation is none, or a size or
        range makes no sense.

    References
    ----------
    The 2010 report, §3.

    Examples
    --------
    >>> K = intrinsics(focal_length=800, principal_point=(639.5, 511.5))
    >>> camera = Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=(1280, 1024))
    >>> camera.project([[0, 0, 1], [0.5, 0, 1.5], [0, -5, 1]]).pixels
    array([[639.5, 511.5],
           [739.5, 411.5],
           [  nan,   nan]])
    """

    K: NDArray[np.float64]
    T_camera_world: NDArray[np.float64]
    size_px: tuple[int, int]
    lens: Lens | None = None
    K_lens: NDArray[np.float64] | None = None
    near: float = 0.0
    far: float = float("inf")
    name: str = ""

    def __post_init__(self) -> None:
        K = _intrinsic("K", self.K)
        T = keep_array("T_camera_world", self.T_camera_world, (4, 4))
        _check_rigid(T)
        size = tuple(self.size_px)
        if len(size) != 2:
            raise ParameterError("size_px", "width and height", self.size_px)
        for side, pixels in zip(("width", "height"), size, strict=True):
            check_number(
                f"size_px ({side})", pixels, above=1, below=100_000, closed=True, integer=True
            )
        if self.lens is not None and not isinstance(self.lens, Lens):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("lens", "a Lens or None", type(self.lens).__name__)
        check_number("near", self.near, above=0, closed=True)
        if not self.far > self.near:
            raise ParameterError("far", f"a number > near ({self.near:g})", self.far)
        object.__setattr__(self, "K", K)
        object.__setattr__(self, "T_camera_world", T)
        object.__setattr__(self, "size_px", (int(size[0]), int(size[1])))
        if self.K_lens is not None:
            object.__setattr__(self, "K_lens", _intrinsic("K_lens", self.K_lens))
        if isinstance(self.lens, QuadraticCorrection) and not self.lens.reaches(*self._start):
            raise ParameterError("lens", "no fold at the centre of the image", self.lens)

    @classmethod
    def look_at(
        cls,
        position: ArrayLike,
        target: ArrayLike,
        *,
        K: ArrayLike,
        size_px: tuple[int, int],
        up: ArrayLike = (0.0, 0.0, 1.0),
        **options: Any,
    ) -> Self:
        """Place a camera and turn it to a target, its image upright.

        Parameters
        ----------
        position, target : array_like, shape (3,)
            World metres.
        K, size_px, **options
            As for the class.
        up : array_like, shape (3,)
            World direction that is up in the image.

        Raises
        ------
        ParameterError
            If position and target are one, or `up` is the direction of sight.
        """
        position, target, up = (
            check_array(name, value, (3,))
            for name, value in (("position", position), ("target", target), ("up", up))
        )
        z = target - position
        x = np.cross(z, up)
        if not np.linalg.norm(z) > 0:
            raise ParameterError("target", "another place than the camera's", target.tolist())
        if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(z) * np.linalg.norm(up):
            raise ParameterError("up", "not the direction of sight", up.tolist())
        z /= np.linalg.norm(z)
        x /= np.linalg.norm(x)
        T = np.eye(4)
        T[:3, :3] = np.stack([x, np.cross(z, x), z])
        T[:3, 3] = -T[:3, :3] @ position
        return cls(K=np.asarray(K), T_camera_world=T, size_px=size_px, **options)

    @classmethod
    def from_matrix(cls, P: ArrayLike, *, size_px: tuple[int, int], **options: Any) -> Self:
        """Take a projection matrix apart.

        Parameters
        ----------
        P : array_like, shape (3, 4)
            Takes homogeneous world metres to homogeneous pixels, up to scale and sign.
        size_px, **options
            As for the class.

        Raises
        ------
        ParameterError
            If the left 3 × 3 part is singular.

        References
        ----------
        R. Hartley, A. Zisserman, Multiple View Geometry (2004), §6.2.4.
        """
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
        return cls(K=K, T_camera_world=T, size_px=size_px, **options)

    @property
    def center(self) -> NDArray[np.float64]:
        """Where the camera stands: its optical centre, shape (3,), world metres."""
        return -self.T_camera_world[:3, :3].T @ self.T_camera_world[:3, 3]

    @property
    def axis(self) -> NDArray[np.float64]:
        """Where it looks: unit vector of the optical axis, shape (3,), world."""
        return self.T_camera_world[2, :3].copy()

    def project(
        self,
        points: ArrayLike,
        surfaces: Sequence[Surface] = (),
        *,
        clearance: float = CLEARANCE,
    ) -> Projection:
        """Say where points fall in the image, and why some are not seen.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            World metres; NaN where there is none. With moving surfaces (T, ..., 3).
        surfaces : sequence of Surface
            What may hide them. A point is hidden if the segment from the camera to it meets one.
        clearance : float
            Metres before the point where a surface does not count, as the point may lie on it.

        Returns
        -------
        Projection
            Arrays of the shape of the points.

        Raises
        ------
        ParameterError
            If the points have another shape, or a moving surface another number of moments.
        """
        return project_points([self], points, surfaces, clearance)[0]

    def undistort(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Give the normalised coordinates ``(X / Z, Y / Z)`` of pixels, the lens undone.

        Parameters
        ----------
        pixels : array_like, shape (..., 2)

        Returns
        -------
        ndarray, shape (..., 2)
            NaN where no ray leads to the pixel: the lens model does not reach so far.
        """
        p = _last_axis("pixels", pixels, 2)
        return self._engine.undistort(p.reshape(-1, 2)).reshape(p.shape)

    def distort(self, normalised: ArrayLike) -> NDArray[np.float64]:
        """Give the pixels of normalised coordinates; the inverse of `undistort`.

        Parameters
        ----------
        normalised : array_like, shape (..., 2)
            ``(X / Z, Y / Z)``.

        Returns
        -------
        ndarray, shape (..., 2)
            Pixels, in the image or not; NaN beyond the lens model.
        """
        p = _last_axis("normalised", normalised, 2)
        return self._engine.distort(p.reshape(-1, 2)).reshape(p.shape)

    def rays(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Give the direction in which each pixel looks, from `center`.

        Parameters
        ----------
        pixels : array_like, shape (..., 2)

        Returns
        -------
        ndarray, shape (..., 3)
            Unit vectors in the world; NaN where the lens model does not reach.
        """
        n = self.undistort(pixels)
        d = np.concatenate([n, np.ones((*n.shape[:-1], 1))], axis=-1)
        d /= np.linalg.norm(d, axis=-1, keepdims=True)
        return d @ self.T_camera_world[:3, :3]

    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]:
        """Give the derivative of pixels by the coordinates of their points.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            World metres.

        Returns
        -------
        ndarray, shape (..., 2, 3)
            Pixels per metre; NaN where a point has no pixel.
        """
        p = _last_axis("points", points, 3)
        return self._engine.jacobian(p.reshape(-1, 3)).reshape(*p.shape[:-1], 2, 3)

    def replace(self, **changes: Any) -> Self:
        """Give the camera with some of its fields changed."""
        return replace(self, **changes)

    @property
    def lens_matrix(self) -> NDArray[np.float64]:
        """The matrix between pixels and lens coordinates in use: `K_lens` or its default."""
        if self.K_lens is not None:
            return self.K_lens
        if self.lens is None or not self.lens.in_pixels:
            return self.K
        return np.array([[1.0, 0.0, self.K[0, 2]], [0.0, 1.0, self.K[1, 2]], [0.0, 0.0, 1.0]])

    @property
    def _start(self) -> NDArray[np.float64]:
        """The centre of the image in lens coordinates."""
        w, h = self.size_px
        middle = np.array([(w - 1) / 2, (h - 1) / 2, 1.0])
        return np.asarray(np.linalg.solve(self.lens_matrix, middle)[:2], dtype=np.float64)

    @cached_property
    def _engine(self) -> _engine.Camera:
        B = self.lens_matrix if self.lens is not None else self.K
        A = np.eye(3) if B is self.K else np.asarray(np.linalg.solve(B, self.K), np.float64)
        lens = self.lens
        return _engine.Camera(
            R=np.ascontiguousarray(self.T_camera_world[:3, :3]),
            t=np.ascontiguousarray(self.T_camera_world[:3, 3]),
            A=np.ascontiguousarray(A[:2]),
            B=np.ascontiguousarray(B[:2]),
            lens_kind=NO_LENS if lens is None else lens.kind,
            is_backward=lens is not None and lens.is_backward,
            coefficients=np.empty(0) if lens is None else lens.coefficients,
            r_end=float("inf") if lens is None else lens.radius,
            q_table=self._table_extent(),
            start=(float(self._start[0]), float(self._start[1]))
            if lens is not None and lens.kind == QUADRATIC
            else (0.0, 0.0),
            near=self.near,
            far=self.far,
            width=self.size_px[0],
            height=self.size_px[1],
        )

    def _table_extent(self) -> float:
        """Squared radius of the image in the coordinates from which a radial lens is solved."""
        if self.lens is None or self.lens.kind == QUADRATIC:
            return 0.0
        w, h = self.size_px
        corners = np.array([[u, v, 1.0] for u in (-0.5, w - 0.5) for v in (-0.5, h - 0.5)])
        r = float(np.linalg.norm(np.linalg.solve(self.lens_matrix, corners.T)[:2], axis=0).max())
        if self.lens.is_backward:
            r = min(r, self.lens.radius)
            k = self.lens.coefficients
            r *= 1 + r**2 * (k[0] + r**2 * (k[1] + r**2 * k[2]))
        return r**2

    @cached_property
    def _ray_grid(self) -> _engine.RayGrid:
        return _engine.RayGrid(self._engine)

    def __repr__(self) -> str:
        w, h = self.size_px
        name = f"{self.name!r}, " if self.name else ""
        at = ", ".join(f"{c:.3g}" for c in self.center)
        lens = f", {type(self.lens).__name__}" if self.lens is not None else ""
        return f"Camera({name}{w} × {h} px, f {self.K[0, 0]:.4g} px, at ({at}) m{lens})"


def project_points(
    cameras: Sequence[Camera],
    points: ArrayLike,
    surfaces: Sequence[Surface],
    clearance: float,
) -> Projection:
    """Project points ``(..., 3)`` through several cameras; see `Camera.project`.

    Returns
    -------
    Projection
        With a leading axis of cameras.
    """
    p = _last_axis("points", points, 3)
    check_number("clearance", clearance, above=0, closed=True)
    shape: tuple[int, ...] = p.shape[:-1]
    # Moving surfaces belong to the first axis of the points.
    is_moving = len(shape) > 1 or any(s.n_moments > 1 for s in surfaces)
    n_frames = shape[0] if is_moving and shape else 1
    compiled = compile_surfaces(surfaces, n_frames) if len(surfaces) else []
    if not p.size:
        n_frames, compiled = 1, []
    pixels, depth, reason, hidden_by = _engine.project(
        cameras=[c._engine for c in cameras],  # pyright: ignore[reportPrivateUsage]
        points=p.reshape(n_frames, -1, 3),
        surfaces=compiled,
        clearance=float(clearance),
    )
    C = len(cameras)
    return Projection(
        pixels=pixels.reshape(C, *shape, 2),
        depth=depth.reshape(C, *shape),
        reason=reason.reshape(C, *shape),
        hidden_by=hidden_by.reshape(C, *shape),
    )


def _last_axis(name: str, value: ArrayLike, n: int) -> NDArray[np.float64]:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim < 1 or array.shape[-1] != n:
        got = f"shape {array.shape} of {array.dtype}"
        raise ParameterError(name, f"an array of shape (..., {n}) of numbers", got)
    return np.ascontiguousarray(array, dtype=np.float64)


def _intrinsic(name: str, value: ArrayLike) -> NDArray[np.float64]:
    K = keep_array(name, value, (3, 3))
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise ParameterError(
            name, "focal lengths > 0 on the diagonal", f"{K[0, 0]:g} and {K[1, 1]:g}"
        )
    if K[1, 0] != 0 or (K[2] != (0.0, 0.0, 1.0)).any():
        raise ParameterError(name, "[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]", K.tolist())
    return K


def _check_rigid(T: NDArray[np.float64]) -> None:
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
