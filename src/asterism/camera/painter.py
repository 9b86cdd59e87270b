"""Painter's algorithm (2010 report, §3.4): faces drawn over each other, the farthest first.

It fails if faces overlap in a circle, each in front of the next, or intersect: then no order is
right. Such groups are reported as cycles. The z-buffer of `Camera.depth_image` has no such cases.
"""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.camera.depth_image import DepthImage
from asterism.camera.surfaces import Mesh, Polygon
from asterism.errors import ParameterError, SolverLimit
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.camera.surfaces import Surface

__all__ = ["Face", "Painting", "in_painters_order"]

MAX_FACES = 2000
"""Largest number of faces, because every pair of faces is compared."""

NEAREST = 1e-6
"""Distance in front of the camera at which faces are clipped, metres."""


class Face(NamedTuple):
    """Unit of the painting order: a polygon (face 0), or one triangle of a mesh.

    Parameters
    ----------
    surface : int
        Number of the surface.
    face : int
        Number of the triangle in its mesh; 0 for a polygon.

    Examples
    --------
    >>> import asterism as am
    >>> am.camera.Face(surface=1, face=0)
    Face(surface=1, face=0)
    """

    surface: int
    face: int


@record(eq=False)
class Painting(DepthImage):
    """Result of the painter's algorithm: the painting order and its conflicts.

    Parameters
    ----------
    depth : ndarray of shape (height, width)
        Depth along the optical axis of the face that was painted last on each pixel, metres;
        infinite where there is none.
    surface : ndarray of int32, shape (height, width)
        Number of the surface of that face, -1 where there is none.
    order : tuple of Face
        Faces in the order of painting, the farthest first.
    cycles : tuple of tuple of Face
        Groups of faces without a right order: each face is, directly or through others, both in
        front of and behind every other one. The image may be wrong in these faces.

    Examples
    --------
    >>> import asterism as am
    >>> K = am.camera.intrinsics(focal_length=40, principal_point=(31.5, 23.5))
    >>> camera = am.Camera.look_at((0, -4, 0), (0, 0, 0), K=K, size_px=(64, 48))
    >>> square = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    >>> near, far = (am.camera.Polygon(corners=square + [0, y, 0]) for y in (-1, 1))
    >>> painting = camera.paint([near, far])
    >>> [face.surface for face in painting.order], painting.cycles
    ([1, 0], ())
    """

    order: tuple[Face, ...]
    cycles: tuple[tuple[Face, ...], ...]


class _Faces(NamedTuple):
    """Faces in camera coordinates, each as triangles."""

    names: list[Face]
    triangles: list[NDArray[np.float64]]  # (n, 3, 3) each


def in_painters_order(
    surfaces: Sequence[Surface], moment: int, T_camera_world: NDArray[np.float64]
) -> tuple[_Faces, list[int], list[list[int]]]:
    """Compute the painting order of surfaces.

    Parameters
    ----------
    surfaces : sequence of Polygon or Mesh
        Surfaces to paint.
    moment : int
        Frame of moving surfaces.
    T_camera_world : ndarray of shape (4, 4)
        Pose of the camera.

    Returns
    -------
    faces : _Faces
        Faces with their triangles in camera coordinates.
    order : list of int
        Faces from the farthest to the nearest.
    cycles : list of list of int
        Groups of faces without a right order; in `order` they are sorted by their mean depth.

    Raises
    ------
    ParameterError
        If there is a capsule among them.
    SolverLimit
        If there are more than 2000 faces.

    Examples
    --------
    >>> from asterism.camera import Polygon
    >>> corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    >>> squares = [Polygon(corners=corners + [0, 0, depth]) for depth in (2, 5, 3)]
    >>> _, order, cycles = in_painters_order(squares, 0, np.eye(4))
    >>> order, cycles
    ([1, 2, 0], [])
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = _faces(surfaces, moment, T_camera_world)
    n = len(faces.names)
    if n > MAX_FACES:
        raise SolverLimit("faces to paint", n, MAX_FACES, "use Camera.depth_image, the z-buffer")
    behind, front = _relations(faces.triangles)
    graph = coo_array((np.ones(len(behind)), (behind, front)), shape=(n, n))
    n_groups, group = connected_components(graph, directed=True, connection="strong")
    depth = np.array([t[..., 2].mean() for t in faces.triangles])
    members: list[list[int]] = [[] for _ in range(n_groups)]
    for i in np.argsort(-depth, kind="stable"):
        members[group[i]].append(int(i))
    # Groups in topological order; of the possible next ones the farthest is first.
    after: list[set[int]] = [set() for _ in range(n_groups)]
    for b, f in zip(group[behind], group[front], strict=True):
        if b != f:
            after[b].add(int(f))
    waiting = np.zeros(n_groups, dtype=int)
    for followers in after:
        for g in followers:
            waiting[g] += 1
    ready = [(-depth[members[g][0]], members[g][0], g) for g in range(n_groups) if not waiting[g]]
    heapq.heapify(ready)
    order: list[int] = []
    while ready:
        g = heapq.heappop(ready)[2]
        order += members[g]
        for f in sorted(after[g]):
            waiting[f] -= 1
            if not waiting[f]:
                heapq.heappush(ready, (-depth[members[f][0]], members[f][0], f))
    return faces, order, [m for m in members if len(m) > 1]


def _faces(surfaces: Sequence[Surface], moment: int, T_camera_world: NDArray[np.float64]) -> _Faces:
    names: list[Face] = []
    triangles: list[NDArray[np.float64]] = []
    R, t = T_camera_world[:3, :3], T_camera_world[:3, 3]
    for i, surface in enumerate(surfaces):
        if isinstance(surface, Polygon):
            points, groups = surface.corners, [surface.faces]
        elif isinstance(surface, Mesh):
            points, groups = surface.vertices, [face[None] for face in surface.faces]
        else:
            raise ParameterError(
                f"surfaces[{i}]", "a Polygon or a Mesh, made of flat faces", type(surface).__name__,
                "use Camera.depth_image, which draws capsules too",
            )  # fmt: skip
        seen = points[moment if surface.n_moments > 1 else 0] @ R.T + t
        names += [Face(i, f) for f in range(len(groups))]
        triangles += [seen[g] for g in groups]
    return _Faces(names, triangles)


def _relations(faces: list[NDArray[np.float64]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs of faces (behind, in front) that overlap in the image."""
    flat = [[_project(t) for t in face] for face in faces]
    boxes = np.array(
        [
            [np.inf, np.inf, -np.inf, -np.inf]
            if not any(len(p) for p in polygons)
            else [*np.concatenate(polygons).min(axis=0), *np.concatenate(polygons).max(axis=0)]
            for polygons in flat
        ]
    ).reshape(-1, 4)
    low, high = boxes[:, :2], boxes[:, 2:]
    meets = (low[:, None] < high[None]).all(axis=2)
    pairs = np.argwhere(np.triu(meets & meets.T, 1))
    behind: list[int] = []
    front: list[int] = []
    for i, j in pairs:
        for a, flat_a in zip(faces[i], flat[i], strict=True):
            for b, flat_b in zip(faces[j], flat[j], strict=True):
                nearer, farther = _compare(a, flat_a, b, flat_b)
                if nearer:
                    behind.append(j)
                    front.append(i)
                if farther:
                    behind.append(i)
                    front.append(j)
    return np.array(behind, dtype=np.int64), np.array(front, dtype=np.int64)


def _project(triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the part of a triangle in front of the camera, normalised coordinates (n, 2)."""
    kept = _cut(triangle, triangle[:, 2] - NEAREST)
    return kept[:, :2] / kept[:, 2:]


def _cut(polygon: NDArray[np.float64], inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Clip a convex polygon to where a linear function, given at its corners, is positive."""
    kept: list[NDArray[np.float64]] = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if inside[i] >= 0:
            kept.append(polygon[i])
        if (inside[i] > 0) != (inside[j] > 0) and inside[i] != inside[j]:
            s = inside[i] / (inside[i] - inside[j])
            kept.append(polygon[i] + s * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, polygon.shape[1])


def _compare(
    a: NDArray[np.float64],
    flat_a: NDArray[np.float64],
    b: NDArray[np.float64],
    flat_b: NDArray[np.float64],
) -> tuple[bool, bool]:
    """Return whether triangle a is somewhere nearer than b, and whether somewhere farther."""
    common = flat_a
    turn = _doubled_area(flat_b)
    for i in range(len(flat_b)):
        if len(common) < 3:
            return False, False
        p, q = flat_b[i], flat_b[(i + 1) % len(flat_b)]
        d = common - p
        common = _cut(common, turn * ((q[0] - p[0]) * d[:, 1] - (q[1] - p[1]) * d[:, 0]))
    smallest = 1e-9 * min(abs(_doubled_area(flat_a)), abs(turn))
    if len(common) < 3 or abs(_doubled_area(common)) <= smallest:
        return False, False
    # The inverse depth of a plane is linear in the image, so its corners suffice.
    rays = np.column_stack([common, np.ones(len(common))])
    difference = rays @ _inverse_depth(a) - rays @ _inverse_depth(b)
    margin = 1e-9 * float(np.abs(rays @ _inverse_depth(a)).max())
    return bool((difference > margin).any()), bool((difference < -margin).any())


def _inverse_depth(triangle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return m with ``1 / z = m · (x, y, 1)`` on the plane of a triangle."""
    normal = np.asarray(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]))
    offset = float(normal @ triangle[0])
    return normal / offset if offset != 0 else np.zeros(3)


def _doubled_area(p: NDArray[np.float64]) -> float:
    if len(p) < 3:
        return 0.0
    x, y = p.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
