"""Lines that draw a surface: edges of polygons and meshes, contours of capsules."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Capsule, Mesh, Polygon
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Surface

__all__ = ["outlines"]

_ARC = 12  # pieces of a quarter of a circle


def outlines(surface: Surface, moment: int = 0) -> list[NDArray[np.float64]]:
    """Return the lines of the outline of a surface.

    Parameters
    ----------
    surface : Surface
        Polygon (its edge), mesh (each edge of its triangles once) or capsule (the circles at its
        ends and two perpendicular outlines).
    moment : int
        Frame of a moving surface; not used for a surface at rest.

    Returns
    -------
    list of ndarray of shape (n, 3)
        Lines through n points each, world metres.

    Raises
    ------
    ParameterError
        If a moving surface has no such frame.
    """
    n = surface.n_moments
    if n > 1 and not 0 <= moment < n:
        raise ParameterError("moment", f"0 to {n - 1}, as the surface moves", moment)
    i = moment if n > 1 else 0
    if isinstance(surface, Polygon):
        corners = surface.corners[i]
        return [np.concatenate([corners, corners[:1]])]
    if isinstance(surface, Mesh):
        ends = np.sort(surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        return list(surface.vertices[i][np.unique(ends, axis=0)])
    if isinstance(surface, Capsule):
        return _capsule(surface.ends[i], surface.radius)
    raise ParameterError("surface", "a Polygon, Mesh or Capsule", type(surface).__name__)


def _capsule(ends: NDArray[np.float64], radius: float) -> list[NDArray[np.float64]]:
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    along = along / length if length > 0 else np.array([0.0, 0.0, 1.0])
    # Any perpendicular direction serves; the axis that is nearest to it is numerically safe.
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    other = np.cross(along, across)
    angle = np.linspace(0, 2 * np.pi, 4 * _ARC + 1)[:, None]
    circle = radius * (np.cos(angle) * across + np.sin(angle) * other)
    lines = [ends[0] + circle, ends[1] + circle] if length > 0 else [ends[0] + circle]
    half = np.linspace(0, np.pi, 2 * _ARC + 1)[:, None]
    for side in (across, other):
        top = ends[1] + radius * (np.cos(half) * side + np.sin(half) * along)
        bottom = ends[0] - radius * (np.cos(half) * side + np.sin(half) * along)
        lines.append(np.concatenate([top, bottom, top[:1]]))
    return lines
