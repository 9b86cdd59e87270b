"""Rig: several calibrated cameras in one world frame."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np

from asterism.camera.camera import Camera
from asterism.camera.matrices import intrinsics
from asterism.camera.project import CLEARANCE, project_points
from asterism.checks import check_array, check_fields, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera.projection import Projection
    from asterism.camera.surfaces import Surface

__all__ = ["Coverage", "Rig", "volume_grid"]

SIZE_PX, FOCAL_PX = (1280, 1024), 900.0
"""A usual motion-capture camera: 1.3 megapixels, 71° wide."""


@record(eq=False)
class Coverage:
    """Coverage of positions by a rig: number of cameras and triangulation accuracy.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Positions, world metres.
    n_cameras : ndarray of int, shape (...)
        Number of cameras that see each position.
    covariance : ndarray of shape (..., 3, 3)
        Covariance of a point triangulated there from all cameras that see it, m²: the inverse of
        the summed information ``JᵀJ / σ²`` (the Cramér-Rao bound). NaN if fewer than two cameras
        see the position, or if they and the position lie on one line.
    sigma_px : float
        Standard deviation of an image point in the computation, pixels per axis.

    Examples
    --------
    >>> import asterism as am
    >>> coverage = am.Rig.ring(4, radius=4, height=2).coverage([[0, 0, 1], [0, 0, 9]])
    >>> coverage
    Coverage(2 positions, 1 seen by two cameras or more, noise 0.3 px)
    >>> coverage.error.round(4)  # metres
    array([0.0015,    nan])
    """

    points: NDArray[np.float64]
    n_cameras: NDArray[np.int64]
    covariance: NDArray[np.float64]
    sigma_px: float

    def __repr__(self) -> str:
        n = self.n_cameras
        return (
            f"Coverage({n.size} positions, {int((n >= 2).sum())} seen by two cameras or more, "
            f"noise {self.sigma_px:g} px)"
        )

    @property
    def error(self) -> NDArray[np.float64]:
        """Root mean square error of a triangulated point, metres, shape (...)."""
        return np.sqrt(np.trace(self.covariance, axis1=-2, axis2=-1))


@record(eq=False, kw_only=False)
class Rig:
    """Cameras in one world frame; a sequence, indexed by number or by name.

    Parameters
    ----------
    cameras : sequence of Camera
        At least one camera. The names differ; a camera without a name has its number from 1.
    warnings : tuple of str
        Unusual values in the file from which the rig was read.

    Raises
    ------
    ParameterError
        If there is no camera, or two have the same name.

    Examples
    --------
    >>> rig = Rig.ring(8, radius=4.0, height=2.5)
    >>> rig.project([[0.0, 0.0, 1.0]]).pixels.shape
    (8, 1, 2)
    >>> int(rig.coverage([0.0, 0.0, 1.0]).n_cameras)
    8
    >>> rig["cam2"].name, rig[:3].names
    ('cam2', ('cam1', 'cam2', 'cam3'))
    >>> rig.replace(warnings=("cam3 was moved",)).warnings
    ('cam3 was moved',)
    >>> Rig.wall(3, width=4, height=2, distance=5)
    Rig(3 cameras: cam1, cam2, cam3)
    """

    cameras: tuple[Camera, ...]
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        cameras = tuple(self.cameras)
        if not cameras:
            raise ParameterError("cameras", "at least one", "none")
        for i, camera in enumerate(cameras):
            if not isinstance(camera, Camera):  # pyright: ignore[reportUnnecessaryIsInstance]
                raise ParameterError(f"cameras[{i}]", "a Camera", type(camera).__name__)
        names = [c.name or str(i + 1) for i, c in enumerate(cameras)]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("cameras", "different names", f"{name!r} more than once")
        object.__setattr__(self, "cameras", cameras)
        object.__setattr__(self, "warnings", tuple(self.warnings))

    @classmethod
    def ring(
        cls,
        n: int,
        *,
        radius: float,
        height: float,
        target: ArrayLike = (0.0, 0.0, 1.0),
        focal_px: float = FOCAL_PX,
        size_px: tuple[int, int] = SIZE_PX,
        **options: Any,
    ) -> Self:
        """Place cameras evenly on a circle, all looking at one point; z is up.

        Parameters
        ----------
        n : int
            Number of cameras, ≥ 1, named ``cam1`` and so on; the first is at +x of the target.
        radius : float
            Radius of the circle about the target's vertical, metres, > 0.
        height : float
            Height of the cameras above z = 0, metres.
        target : array_like of shape (3,)
            Point at which all cameras look, metres.
        focal_px : float
            Focal length of every camera, pixels. The defaults of 900 px and 1280 × 1024 px are a
            typical motion-capture camera with a field of view of 71°.
        size_px : (int, int)
            Width and height of every image.
        **options
            Further fields of every `Camera`, except its name.

        Returns
        -------
        Rig

        Raises
        ------
        ParameterError
            If a number is out of range.

        Examples
        --------
        >>> Rig.ring(3, radius=4, height=2.5)[0]
        Camera('cam1', 1280 × 1024 px, f 900 px, at (4, 0, 2.5) m)
        """
        check_number("n", n, above=1, closed=True, integer=True)
        check_number("radius", radius, above=0)
        target = check_array("target", target, (3,))
        check_number("height", height)
        n = int(n)
        angles = 2 * np.pi * np.arange(n) / n
        places = np.stack(
            [
                target[0] + radius * np.cos(angles),
                target[1] + radius * np.sin(angles),
                np.full(n, float(height)),
            ],
            axis=1,
        )
        return cls._placed(places, target, focal_px, size_px, options)

    @classmethod
    def wall(
        cls,
        n: int,
        *,
        width: float,
        height: float,
        distance: float,
        target: ArrayLike = (0.0, 0.0, 1.0),
        focal_px: float = FOCAL_PX,
        size_px: tuple[int, int] = SIZE_PX,
        **options: Any,
    ) -> Self:
        """Place cameras in a row along a wall, all looking at one point; z is up.

        Parameters
        ----------
        n : int
            Number of cameras, ≥ 1, named ``cam1`` and so on from left to right as seen from the
            target.
        width : float
            Length of the row, metres, ≥ 0; it runs along x, centred on the target.
        height : float
            Height of the cameras above z = 0, metres.
        distance : float
            Distance of the row from the target, towards -y, metres, > 0.
        target, focal_px, size_px, **options
            As for `ring`.

        Returns
        -------
        Rig
        """
        check_number("n", n, above=1, closed=True, integer=True)
        check_number("width", width, above=0, closed=True)
        check_number("distance", distance, above=0)
        target = check_array("target", target, (3,))
        check_number("height", height)
        n = int(n)
        x = target[0] + (np.linspace(0.5, -0.5, n) * width if n > 1 else np.zeros(1))
        y, z = np.full(n, target[1] - distance), np.full(n, float(height))
        return cls._placed(np.stack([x, y, z], axis=1), target, focal_px, size_px, options)

    @classmethod
    def _placed(
        cls,
        places: NDArray[np.float64],
        target: NDArray[np.float64],
        focal_px: float,
        size_px: tuple[int, int],
        options: dict[str, Any],
    ) -> Self:
        if len(np.shape(size_px)) != 1 or len(size_px) != 2 or "name" in options:
            expected = "width and height" if "name" not in options else "no name: cam1, cam2 …"
            raise ParameterError("size_px" if "name" not in options else "name", expected, size_px)
        w, h = size_px
        K = intrinsics(focal_length=focal_px, principal_point=((w - 1) / 2, (h - 1) / 2))
        return cls(
            tuple(
                Camera.look_at(p, target, K=K, size_px=size_px, name=f"cam{i + 1}", **options)
                for i, p in enumerate(places)
            )
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each camera, or its number from 1 without a name."""
        return tuple(c.name or str(i + 1) for i, c in enumerate(self.cameras))

    def project(
        self,
        points: ArrayLike,
        surfaces: Sequence[Surface] = (),
        *,
        clearance: float = CLEARANCE,
    ) -> Projection:
        r"""Project points into every image, with the reason for each point that is not seen.

        Parameters
        ----------
        points, surfaces, clearance
            As for `Camera.project`.

        Returns
        -------
        Projection
            Arrays of the shape (cameras, \*points).
        """
        return project_points([c.engine for c in self.cameras], points, surfaces, clearance)

    def coverage(
        self, points: ArrayLike, surfaces: Sequence[Surface] = (), *, sigma_px: float = 0.3
    ) -> Coverage:
        """Compute for each position the number of cameras and the accuracy of triangulation.

        Parameters
        ----------
        points : array_like of shape (..., 3)
            Positions, world metres; `volume_grid` makes a grid of them.
        surfaces : sequence of Surface
            Surfaces that may occlude the positions.
        sigma_px : float
            Standard deviation of an image point, pixels per axis, > 0; errors are proportional.

        Returns
        -------
        Coverage
        """
        check_number("sigma_px", sigma_px, above=0)
        projection = self.project(points, surfaces)
        places = np.asarray(points, dtype=np.float64)
        information = np.zeros((*places.shape[:-1], 3, 3))
        for camera, seen in zip(self.cameras, projection.visible, strict=True):
            J = camera.jacobian(places[seen])
            information[seen] += np.swapaxes(J, -1, -2) @ J / sigma_px**2
        n_cameras = projection.visible.sum(axis=0)
        covariance = np.full(information.shape, np.nan)
        # Two rays along one line do not determine the depth: the information is singular.
        is_known = (n_cameras >= 2) & (np.linalg.cond(information) < 1e12)
        covariance[is_known] = np.linalg.inv(information[is_known])
        return Coverage(
            points=places, n_cameras=n_cameras, covariance=covariance, sigma_px=sigma_px
        )

    def replace(self, **changes: Any) -> Self:
        """Return a copy of the rig with some fields changed.

        Parameters
        ----------
        **changes
            Fields of `Rig` by name.

        Returns
        -------
        Rig
        """
        return replace(self, **changes)

    def __len__(self) -> int:
        return len(self.cameras)

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras)

    @overload
    def __getitem__(self, key: int | str) -> Camera: ...
    @overload
    def __getitem__(self, key: slice) -> Self: ...
    def __getitem__(self, key: int | str | slice) -> Camera | Self:
        if isinstance(key, slice):
            return type(self)(self.cameras[key], self.warnings)
        if isinstance(key, str):
            check_fields("camera", [key], self.names)
            return self.cameras[self.names.index(key)]
        return self.cameras[key]

    def __repr__(self) -> str:
        return f"Rig({len(self)} cameras: {', '.join(self.names)})"


def volume_grid(low: ArrayLike, high: ArrayLike, spacing: float) -> NDArray[np.float64]:
    """Return the points of a regular grid in a box.

    Parameters
    ----------
    low, high : array_like of shape (3,)
        Corners of the box, metres; the grid starts at `low` and ends at or before `high`.
    spacing : float
        Distance between neighbours, metres, > 0.

    Returns
    -------
    ndarray of shape (n_x, n_y, n_z, 3)

    Examples
    --------
    >>> volume_grid((-1, -1, 0), (1, 1, 2), 0.5).shape
    (5, 5, 5, 3)
    """
    low, high = check_array("low", low, (3,)), check_array("high", high, (3,))
    check_number("spacing", spacing, above=0)
    if (high < low).any():
        raise ParameterError("high", f"a corner beyond {low.tolist()}", high.tolist())
    n = np.floor((high - low) / spacing + 1e-9).astype(int) + 1
    if n.prod(dtype=np.float64) > 1e8:
        raise ParameterError(
            "spacing", "a grid of at most 1e8 positions", f"{n.prod(dtype=float):g}"
        )
    axes = [low[d] + spacing * np.arange(n[d]) for d in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
