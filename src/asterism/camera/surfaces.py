"""Surfaces that occlude points: polygons, meshes and capsules, fixed or moving.

They are seen by nobody themselves: curtains of the 2010 report (§3.4). Both sides hide.
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
    """Surface that occludes points behind it: `Polygon`, `Mesh` or `Capsule`."""

    name: str

    @property
    @abstractmethod
    def n_moments(self) -> int:
        """1 for a fixed surface, otherwise the number of frames T."""

    @abstractmethod
    def during(self, frames: NDArray[np.int64]) -> Self:
        """Return the surface in some of its frames, shape (n,); a fixed surface returns itself."""


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
    """A planar polygon, convex or concave, without holes; a triangle has three corners.

    Parameters
    ----------
    corners : array_like, shape (M, 3) or (T, M, 3)
        In order along the edge, world metres; with T moments, one a frame.
    name : str
        For messages and pictures.

    Raises
    ------
    ParameterError
        If the corners do not lie in a plane, edges cross, or the polygon has no area; or if it
        bends so much while moving that its triangles turn over.
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
        """Return the polygon in some of its frames."""
        return self if self.n_moments == 1 else replace(self, corners=self.corners[frames])


@record(eq=False)
class Mesh(Surface):
    """Triangle mesh with shared corners.

    Parameters
    ----------
    vertices : array_like, shape (V, 3) or (T, V, 3)
        World metres; with T moments, one a frame.
    faces : array_like of int, shape (F, 3)
        Three vertices a triangle.
    name : str
        For messages and pictures.

    Raises
    ------
    ParameterError
        If a face names a vertex that is not there.
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
        """Return the mesh in some of its frames."""
        return self if self.n_moments == 1 else replace(self, vertices=self.vertices[frames])


@record(eq=False)
class Capsule(Surface):
    """Capsule: all points within a distance of a segment, such as a limb.

    Parameters
    ----------
    ends : array_like, shape (2, 3) or (T, 2, 3)
        Ends of the axis, world metres; with T moments, one a frame.
    radius : float
        Metres.
    name : str
        For messages and pictures.
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
        """Return the capsule in some of its frames."""
        return self if self.n_moments == 1 else replace(self, ends=self.ends[frames])


def check_surfaces(surfaces: Sequence[Surface]) -> None:
    """Raise a ParameterError unless all objects are surfaces."""
    if not isinstance(surfaces, (list, tuple)):
        raise ParameterError("surfaces", "a list or tuple of surfaces", type(surfaces).__name__)
    for i, surface in enumerate(surfaces):
        if not isinstance(surface, (Polygon, Mesh, Capsule)):
            raise ParameterError(
                f"surfaces[{i}]", "a Polygon, Mesh or Capsule", type(surface).__name__
            )


def compile_surfaces(surfaces: Sequence[Surface], n_frames: int) -> list[_engine.Surfaces]:
    """Convert surfaces to engine objects, one for the fixed and one for the moving ones.

    Raises
    ------
    ParameterError
        If a moving one has not `n_frames` moments.
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
