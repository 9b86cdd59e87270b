"""Camera: pin-hole, lens, pose in the world and image size."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from asterism import _engine
from asterism.camera.compiled import compile_camera, middle_of_image
from asterism.camera.depth_image import DepthImage
from asterism.camera.lens import Lens, QuadraticCorrection
from asterism.camera.matrices import checked_intrinsics, checked_pose, decomposed, looking_at
from asterism.camera.painter import Painting, in_painters_order
from asterism.camera.project import CLEARANCE, as_coordinates, project_points
from asterism.camera.surfaces import check_surfaces, compile_surfaces
from asterism.checks import check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera.projection import Projection
    from asterism.camera.surfaces import Surface

__all__ = ["Camera"]


@record(eq=False)
class Camera:
    """Pin-hole camera with a lens model, a pose in the world and an image size.

    ``T_camera_world`` takes a point to camera coordinates, which become ``(X / Z, Y / Z)``, then
    pass the lens, then become the pixel ``K (x, y, 1)``. The camera looks along +z. Pixels count
    from the centre of the top left pixel, u to the right, v down; the image spans -0.5 to w - 0.5.

    Parameters
    ----------
    K : array_like of shape (3, 3)
        ``[[f_u, s, u0], [0, f_v, v0], [0, 0, 1]]``, pixels; s is the skew.
    T_camera_world : array_like of shape (4, 4)
        World to camera coordinates, metres: a rotation and a translation.
    size_px : (int, int)
        Width and height of the image, pixels.
    lens : Lens, optional
        Lens model; None for a pin-hole without distortion.
    K_lens : array_like of shape (3, 3), optional
        Matrix between pixels and lens coordinates, if a calibration has one apart from K: an ideal
        pixel p becomes ``K_lens distort(K_lens⁻¹ p)``. By default K, or for a lens in pixels the
        translation to the principal point.
    near, far : float
        Range of depths along the optical axis in which points are seen, metres; all by default.
    name : str
        Name in files, messages and figures.

    Raises
    ------
    ParameterError
        If a matrix has not its form, or a size or range is impossible.

    References
    ----------
    The 2010 report, §3.

    Examples
    --------
    >>> from asterism.camera import intrinsics
    >>> K = intrinsics(focal_length=800, principal_point=(639.5, 511.5))
    >>> camera = Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=(1280, 1024))
    >>> camera.project([[0, 0, 1], [0.5, 0, 1.5], [0, -5, 1]]).pixels
    array([[639.5, 511.5],
           [739.5, 411.5],
           [  nan,   nan]])
    >>> camera.center, camera.axis, camera.rays([639.5, 511.5])
    (array([ 0., -4.,  1.]), array([0., 1., 0.]), array([0., 1., 0.]))
    >>> camera.distort(camera.undistort([100.0, 50.0]))
    array([100.,  50.])
    >>> camera.jacobian([0, 0, 1])  # pixels per metre
    array([[ 200.,    0.,    0.],
           [   0.,    0., -200.]])
    >>> bool((camera.lens_matrix == K).all()), camera.replace(name="cam1").name, type(camera.engine)
    (True, 'cam1', <class 'asterism._engine.Camera'>)
    >>> from asterism.camera import Polygon
    >>> wall = Polygon(corners=[[-1, 1, 0], [1, 1, 0], [0, 1, 2]])
    >>> float(camera.depth_image([wall]).depth.min()), camera.paint([wall]).order
    (5.0, (Face(surface=0, face=0),))
    >>> Camera.from_matrix(K @ camera.T_camera_world[:3], size_px=(1280, 1024))
    Camera(1280 × 1024 px, f 800 px, at (0, -4, 1) m)
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
        K = checked_intrinsics("K", self.K)
        T = checked_pose(self.T_camera_world)
        if not isinstance(self.size_px, (tuple, list)) or len(self.size_px) != 2:  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("size_px", "width and height", self.size_px)
        size = self.size_px
        for side, pixels in zip(("width", "height"), size, strict=True):
            check_number(
                f"size_px ({side})", pixels, above=1, below=100_000, closed=True, integer=True
            )
        if self.lens is not None and not isinstance(self.lens, Lens):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("lens", "a Lens or None", type(self.lens).__name__)
        check_number("near", self.near, above=0, closed=True)
        if not isinstance(self.name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("name", "a text", repr(self.name))
        if self.far != float("inf"):
            check_number("far", self.far)
        if not self.far > self.near:
            raise ParameterError("far", f"a number > near ({self.near:g})", self.far)
        object.__setattr__(self, "K", K)
        object.__setattr__(self, "T_camera_world", T)
        object.__setattr__(self, "size_px", (int(size[0]), int(size[1])))
        if self.K_lens is not None:
            object.__setattr__(self, "K_lens", checked_intrinsics("K_lens", self.K_lens))
        if isinstance(self.lens, QuadraticCorrection) and not self.lens.reaches(
            *middle_of_image(self.lens_matrix, self.size_px)
        ):
            raise ParameterError(
                "lens", "a lens that does not fold the centre of the image", self.lens
            )

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
        """Place a camera that looks at a target with an upright image.

        Parameters
        ----------
        position, target : array_like of shape (3,)
            Position of the camera, and point at which it looks, world metres.
        K, size_px, **options
            As for the class.
        up : array_like of shape (3,)
            World direction that is up in the image.

        Raises
        ------
        ParameterError
            If position and target coincide, or `up` is the direction of sight.
        """
        T = looking_at(position, target, up)
        return cls(K=np.asarray(K), T_camera_world=T, size_px=size_px, **options)

    @classmethod
    def from_matrix(cls, P: ArrayLike, *, size_px: tuple[int, int], **options: Any) -> Self:
        """Decompose a projection matrix into a camera.

        Parameters
        ----------
        P : array_like of shape (3, 4)
            Homogeneous world metres to homogeneous pixels, up to scale and sign.
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
        K, T = decomposed(P)
        return cls(K=K, T_camera_world=T, size_px=size_px, **options)

    @property
    def center(self) -> NDArray[np.float64]:
        """Optical centre of the camera, shape (3,), world metres."""
        return -self.T_camera_world[:3, :3].T @ self.T_camera_world[:3, 3]

    @property
    def axis(self) -> NDArray[np.float64]:
        """Unit vector of the optical axis, shape (3,), world axes."""
        return self.T_camera_world[2, :3].copy()

    def project(
        self,
        points: ArrayLike,
        surfaces: Sequence[Surface] = (),
        *,
        clearance: float = CLEARANCE,
    ) -> Projection:
        """Project points into the image, with the reason for each point that is not seen.

        Parameters
        ----------
        points : array_like of shape (..., 3)
            World metres; NaN for an absent point. With moving surfaces (T, ..., 3).
        surfaces : sequence of Surface
            Occluding surfaces. A point is occluded if its segment to the camera meets one.
        clearance : float
            Distance before the point in which no surface occludes it, metres, as it may lie on one.

        Returns
        -------
        Projection
            Arrays of the shape of the points.

        Raises
        ------
        ParameterError
            If the points have another shape, or a moving surface another number of moments.
        """
        return project_points([self.engine], points, surfaces, clearance)[0]

    def undistort(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return undistorted normalised coordinates ``(X / Z, Y / Z)`` of pixels.

        Parameters
        ----------
        pixels : array_like of shape (..., 2)
            (u, v), in the image or not.

        Returns
        -------
        ndarray of shape (..., 2)
            NaN for pixels beyond the lens model.
        """
        p = as_coordinates("pixels", pixels, 2)
        return self.engine.undistort(p.reshape(-1, 2)).reshape(p.shape)

    def distort(self, normalised: ArrayLike) -> NDArray[np.float64]:
        """Return the pixels of normalised coordinates; the inverse of `undistort`.

        Parameters
        ----------
        normalised : array_like of shape (..., 2)
            ``(X / Z, Y / Z)``.

        Returns
        -------
        ndarray of shape (..., 2)
            Pixels, in the image or not; NaN beyond the lens model.
        """
        p = as_coordinates("normalised", normalised, 2)
        return self.engine.distort(p.reshape(-1, 2)).reshape(p.shape)

    def rays(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return the viewing direction of each pixel from `center`.

        Parameters
        ----------
        pixels : array_like of shape (..., 2)
            (u, v), in the image or not.

        Returns
        -------
        ndarray of shape (..., 3)
            Unit vectors, world axes; NaN for pixels beyond the lens model.
        """
        n = self.undistort(pixels)
        d = np.concatenate([n, np.ones((*n.shape[:-1], 1))], axis=-1)
        d /= np.linalg.norm(d, axis=-1, keepdims=True)
        return d @ self.T_camera_world[:3, :3]

    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the derivatives of pixels with respect to the coordinates of their points.

        Parameters
        ----------
        points : array_like of shape (..., 3)
            World metres.

        Returns
        -------
        ndarray of shape (..., 2, 3)
            Pixels per metre; NaN where a point has no pixel.
        """
        p = as_coordinates("points", points, 3)
        return self.engine.jacobian(p.reshape(-1, 3)).reshape(*p.shape[:-1], 2, 3)

    def depth_image(self, surfaces: Sequence[Surface], moment: int = 0) -> DepthImage:
        """Render surfaces into a z-buffer, with the nearest surface on the ray of every pixel.

        Parameters
        ----------
        surfaces : sequence of Surface
            Surfaces to draw. Both sides are seen, at any depth in front of the camera.
        moment : int
            Frame of moving surfaces.

        Returns
        -------
        DepthImage
            Depths at the centre of each pixel, through the lens; the class has an example.
        """
        n = _check_moment(surfaces, moment)
        depth, owner = self._ray_grid.depth_image(
            self.engine, compile_surfaces(surfaces, n), moment
        )
        return DepthImage(depth=depth, surface=owner)

    def paint(self, surfaces: Sequence[Surface], moment: int = 0) -> Painting:
        """Order surfaces by the painter's algorithm, the farthest first, and report conflicts.

        Parameters
        ----------
        surfaces : sequence of Polygon or Mesh
            Surfaces to paint; up to 2000 faces.
        moment : int
            Frame of moving surfaces.

        Returns
        -------
        Painting
            Equal to `depth_image` except in `cycles`; the class has an example.

        Raises
        ------
        ParameterError
            If a surface is a capsule.
        SolverLimit
            If there are more than 2000 faces.
        """
        _check_moment(surfaces, moment)
        faces, order, cycles = in_painters_order(surfaces, moment, self.T_camera_world)
        corners = [faces.triangles[i] for i in order]
        owners = [np.full(len(faces.triangles[i]), faces.names[i].surface) for i in order]
        depth, owner = self._ray_grid.paint(
            np.ascontiguousarray(np.concatenate([np.empty((0, 3, 3)), *corners])),
            np.concatenate([np.empty(0), *owners]).astype(np.int32),
        )
        return Painting(
            depth=depth,
            surface=owner,
            order=tuple(faces.names[i] for i in order),
            cycles=tuple(tuple(faces.names[i] for i in group) for group in cycles),
        )

    def replace(self, **changes: Any) -> Self:
        """Return a copy of the camera with some fields changed."""
        return replace(self, **changes)

    @property
    def lens_matrix(self) -> NDArray[np.float64]:
        """Matrix between pixels and lens coordinates: `K_lens` or its default."""
        if self.K_lens is not None:
            return self.K_lens
        if self.lens is None or not self.lens.in_pixels:
            return self.K
        return np.array([[1.0, 0.0, self.K[0, 2]], [0.0, 1.0, self.K[1, 2]], [0.0, 0.0, 1.0]])

    @cached_property
    def engine(self) -> _engine.Camera:
        """Camera as an engine object."""
        return compile_camera(
            K=self.K,
            lens_matrix=self.lens_matrix,
            T_camera_world=self.T_camera_world,
            lens=self.lens,
            near=self.near,
            far=self.far,
            size_px=self.size_px,
        )

    @cached_property
    def _ray_grid(self) -> _engine.RayGrid:
        return _engine.RayGrid(self.engine)

    def __getstate__(self) -> dict[str, Any]:
        # The engine's object is not pickled; it is made again when it is needed.
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __repr__(self) -> str:
        w, h = self.size_px
        name = f"{self.name!r}, " if self.name else ""
        at = ", ".join(f"{c:.3g}" for c in self.center)
        lens = f", {type(self.lens).__name__}" if self.lens is not None else ""
        return f"Camera({name}{w} × {h} px, f {self.K[0, 0]:.4g} px, at ({at}) m{lens})"


def _check_moment(surfaces: Sequence[Surface], moment: int) -> int:
    check_surfaces(surfaces)
    n = max((s.n_moments for s in surfaces), default=1)
    check_number("moment", moment, above=0, below=max(n - 1, 0), closed=True, integer=True)
    return n
