"""Surfaces that occlude points: polygons, meshes and capsules, fixed or moving.

Surfaces are the curtains of the 2010 report (§3.4). Both sides occlude; no camera reports them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from asterism.camera.polygon import triangulate
from asterism.checks import check_array, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism import _engine

__all__ = ["Capsule", "Mesh", "Polygon", "Surface", "check_surfaces", "compile_surfaces"]


class Surface(ABC):
    """Surface that occludes points behind it: `Polygon`, `Mesh` or `Capsule`.

    Attributes
    ----------
    name : str
        Name in messages and figures.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=10, seed=1)
    >>> limb = truth.surfaces[0]
    >>> isinstance(limb, am.camera.Surface), limb.n_moments, limb.during(np.array([0, 1])).n_moments
    (True, 10, 2)
    """

    name: str

    @property
    @abstractmethod
    def n_moments(self) -> int:
        """1 for a fixed surface, otherwise the number of frames T."""

    @abstractmethod
    def during(self, frames: NDArray[np.int64]) -> Self:
        """Return the surface in some of its frames; a fixed surface returns itself.

        Parameters
        ----------
        frames : ndarray of int, shape (n,)
            Frames to select.

        Returns
        -------
        Surface
        """


def _points(name: str, value: ArrayLike, n: int | str) -> NDArray[np.float64]:
    """Return ``(n, 3)`` or ``(T, n, 3)`` as a read-only ``(moments, n, 3)``."""
    array = np.asarray(value)
    if array.ndim == 2:
        array = array[None]
    array = check_array(name, array, ("T", n, 3)).copy()
    if not len(array):
        raise ParameterError(name, "at least one moment", "none")
    array.flags.writeable = False
    return array


@record(eq=False)
class Polygon(Surface):
    """Planar polygon, convex or concave, without holes.

    Parameters
    ----------
    corners : array_like of shape (M, 3) or (T, M, 3)
        Corners in order along the edge, at least three, world metres; for a moving polygon in each
        of T frames.
    name : str
        Name in messages and figures.
    faces : ndarray of int32, shape (M - 2, 3)
        Triangles of the polygon, which are computed.

    Raises
    ------
    ParameterError
        If the corners do not lie in a plane, edges cross, or the polygon has no area; or if it
        deforms so much while moving that its triangles turn over.

    Examples
    --------
    >>> import asterism as am
    >>> wall = am.camera.Polygon(corners=[[-1, 2, 0], [1, 2, 0], [1, 2, 2], [-1, 2, 2]])
    >>> wall.n_moments, wall.faces.shape, wall.during(np.arange(5)) is wall
    (1, (2, 3), True)
    """

    corners: NDArray[np.float64]
    name: str = ""
    faces: NDArray[np.int32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", _points("corners", self.corners, "M"))
        object.__setattr__(self, "faces", triangulate(self.corners))

    @property
    def n_moments(self) -> int:
        """1 for a fixed surface, otherwise the number of frames."""
        return len(self.corners)

    def during(self, frames: NDArray[np.int64]) -> Self:
        """Return the polygon in some of its frames.

        Parameters
        ----------
        frames : ndarray of int, shape (n,)
            Frames to select.

        Returns
        -------
        Polygon
        """
        return self if self.n_moments == 1 else replace(self, corners=self.corners[frames])


@record(eq=False)
class Mesh(Surface):
    """Triangle mesh with shared corners.

    Parameters
    ----------
    vertices : array_like of shape (V, 3) or (T, V, 3)
        Vertices, world metres; for a moving mesh in each of T frames.
    faces : array_like of int, shape (F, 3)
        Numbers of the three vertices of each triangle.
    name : str
        Name in messages and figures.

    Raises
    ------
    ParameterError
        If a face has the number of a vertex that does not exist.

    Examples
    --------
    >>> import asterism as am
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> rising = np.stack([corners, corners + [0, 0, 0.1], corners + [0, 0, 0.2]])
    >>> mesh = am.camera.Mesh(vertices=rising, faces=[[0, 1, 2], [0, 1, 3]])
    >>> mesh.n_moments, mesh.during(np.array([0])).n_moments
    (3, 1)
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    name: str = ""

    def __post_init__(self) -> None:
        vertices = _points("vertices", self.vertices, "V")
        faces = check_array("faces", self.faces, ("F", 3), dtype=np.int64)
        bad = np.flatnonzero(((faces < 0) | (faces >= vertices.shape[1])).any(axis=1))
        if len(bad):
            i = int(bad[0])
            raise ParameterError(
                "faces",
                f"vertices 0 to {vertices.shape[1] - 1}",
                f"{faces[i].tolist()} at face {i}",
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces.astype(np.int32))

    @property
    def n_moments(self) -> int:
        """1 for a fixed surface, otherwise the number of frames."""
        return len(self.vertices)

    def during(self, frames: NDArray[np.int64]) -> Self:
        """Return the mesh in some of its frames.

        Parameters
        ----------
        frames : ndarray of int, shape (n,)
            Frames to select.

        Returns
        -------
        Mesh
        """
        return self if self.n_moments == 1 else replace(self, vertices=self.vertices[frames])


@record(eq=False)
class Capsule(Surface):
    """Capsule: all points within a distance of a segment, such as a limb.

    Parameters
    ----------
    ends : array_like of shape (2, 3) or (T, 2, 3)
        Ends of the axis, world metres; for a moving capsule in each of T frames.
    radius : float
        Distance of the surface from the axis, metres, > 0.
    name : str
        Name in messages and figures.

    Raises
    ------
    ParameterError
        If an array has another shape, or the radius is not positive.

    Examples
    --------
    >>> import asterism as am
    >>> arm = am.camera.Capsule(ends=[[0, 0, 1], [0.3, 0, 1]], radius=0.05, name="arm")
    >>> arm.n_moments, arm.during(np.arange(5)) is arm
    (1, True)
    >>> rig = am.Rig.ring(4, radius=4, height=1)
    >>> rig.project([0.15, 0.2, 1], surfaces=[arm]).visible  # the arm occludes one view
    array([ True,  True,  True, False])
    """

    ends: NDArray[np.float64]
    radius: float
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", _points("ends", self.ends, 2))
        check_number("radius", self.radius, above=0)

    @property
    def n_moments(self) -> int:
        """1 for a fixed surface, otherwise the number of frames."""
        return len(self.ends)

    def during(self, frames: NDArray[np.int64]) -> Self:
        """Return the capsule in some of its frames.

        Parameters
        ----------
        frames : ndarray of int, shape (n,)
            Frames to select.

        Returns
        -------
        Capsule
        """
        return self if self.n_moments == 1 else replace(self, ends=self.ends[frames])


def check_surfaces(surfaces: Sequence[Surface]) -> None:
    """Raise a ParameterError unless all objects are surfaces.

    Parameters
    ----------
    surfaces : list or tuple of Surface
        Objects to check.

    Examples
    --------
    >>> check_surfaces(["wall"])
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: surfaces[0]: expected a Polygon, Mesh or Capsule, found str
    """
    if not isinstance(surfaces, (list, tuple)):
        raise ParameterError("surfaces", "a list or tuple of surfaces", type(surfaces).__name__)
    for i, surface in enumerate(surfaces):
        if not isinstance(surface, (Polygon, Mesh, Capsule)):
            raise ParameterError(
                f"surfaces[{i}]", "a Polygon, Mesh or Capsule", type(surface).__name__
            )


def compile_surfaces(surfaces: Sequence[Surface], n_frames: int) -> list[_engine.Surfaces]:
    """Convert surfaces to engine objects, one for the fixed and one for the moving ones.

    Parameters
    ----------
    surfaces : sequence of Surface
        Surfaces to convert.
    n_frames : int
        Number of frames T of the points.

    Returns
    -------
    list of _engine.Surfaces

    Raises
    ------
    ParameterError
        If a moving surface has another number of moments than `n_frames`.

    Examples
    --------
    >>> wall = Polygon(corners=[[-1, 2, 0], [1, 2, 0], [1, 2, 2], [-1, 2, 2]])
    >>> len(compile_surfaces([wall], n_frames=10))
    1
    """
    for i, surface in enumerate(surfaces):
        if surface.n_moments not in (1, n_frames):
            expected = "one moment" if n_frames == 1 else f"1 or {n_frames} moments, as the points"
            raise ParameterError(f"surfaces[{i}]", expected, surface.n_moments)
    groups: list[_engine.Surfaces] = []
    for moments in sorted({s.n_moments for s in surfaces}):
        members = [(i, s) for i, s in enumerate(surfaces) if s.n_moments == moments]
        groups.append(_compile(members, moments))
    return groups


def _compile(members: list[tuple[int, Surface]], moments: int) -> _engine.Surfaces:
    from asterism import _engine

    corners: list[NDArray[np.float64]] = [np.empty((moments, 0, 3))]
    faces: list[NDArray[np.int32]] = [np.empty((0, 3), np.int32)]
    owners: list[NDArray[np.int32]] = [np.empty(0, np.int32)]
    capsules = [(i, s) for i, s in members if isinstance(s, Capsule)]
    first = 0
    for i, surface in members:
        if isinstance(surface, Polygon):
            points, triangles = surface.corners, surface.faces
        elif isinstance(surface, Mesh):
            points, triangles = surface.vertices, surface.faces
        else:
            continue
        corners.append(points)
        faces.append(triangles + np.int32(first))
        owners.append(np.full(len(triangles), i, np.int32))
        first += points.shape[1]
    ends = [np.empty((moments, 0, 2, 3)), *(s.ends[:, None] for _, s in capsules)]
    return _engine.Surfaces(
        vertices=np.ascontiguousarray(np.concatenate(corners, axis=1)),
        faces=np.concatenate(faces),
        face_owners=np.concatenate(owners),
        ends=np.ascontiguousarray(np.concatenate(ends, axis=1)),
        radii=np.array([s.radius for _, s in capsules], dtype=np.float64),
        capsule_owners=np.array([i for i, _ in capsules], dtype=np.int32),
    )
