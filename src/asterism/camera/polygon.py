"""Triangulation of a planar polygon, convex or concave."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["triangulate"]

FLATNESS = 1e-6
"""Largest distance of a corner from the plane, as a share of the polygon's size."""


def triangulate(corners: NDArray[np.float64]) -> NDArray[np.int32]:
    """Cut a polygon into triangles by clipping ears.

    Parameters
    ----------
    corners : ndarray of shape (T, M, 3)
        Corners of the polygon in each of T frames, metres.

    Returns
    -------
    ndarray of int32, shape (M - 2, 3)
        Corners of each triangle, the same in all frames. There are fewer triangles if corners lie
        on a straight edge.

    Raises
    ------
    ParameterError
        If there are fewer than three corners, they do not lie in a plane, two edges cross, the area
        is zero, or the triangles of the first moment turn over at another.

    References
    ----------
    G. H. Meisters, Polygons have ears, American Mathematical Monthly 82 (1975).

    Examples
    --------
    >>> arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]])  # concave
    >>> len(triangulate(arrow[None].astype(float)))
    2
    """
    n = corners.shape[1]
    if n < 3:
        raise ParameterError("corners", "at least 3", n)
    centred = corners - corners.mean(axis=1, keepdims=True)
    # Newell's normal: twice the area, whatever the shape.
    normals = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    size = np.linalg.norm(centred, axis=2).max(axis=1)
    doubled_areas = np.linalg.norm(normals, axis=1)
    for t in np.flatnonzero(doubled_areas <= 1e-12 * size**2):
        raise ParameterError("corners", "a polygon with an area", f"none at moment {t}")
    normals /= doubled_areas[:, None]
    heights = np.abs(np.einsum("tmd,td->tm", centred, normals))
    t, i = np.unravel_index(int(np.argmax(heights - FLATNESS * size[:, None])), heights.shape)
    if heights[t, i] > FLATNESS * size[t]:
        raise ParameterError(
            "corners",
            f"a plane, within {FLATNESS:g} of the polygon's size",
            f"corner {i} {heights[t, i]:g} m off it at moment {t}",
            "use a Mesh, which may bend",
        )
    flat = _flatten(centred[0], normals[0])
    crossing = _crossing_edges(flat)
    if crossing is not None:
        raise ParameterError(
            "corners", "edges that do not cross", f"edges {crossing[0]} and {crossing[1]} do"
        )
    faces = np.array(_clip_ears(flat), dtype=np.int32)
    a, b, c = (corners[:, faces[:, k]] for k in range(3))
    sides = np.einsum("tfd,td->tf", np.cross(b - a, c - a), normals)
    t, f = np.unravel_index(int(np.argmin(sides)), sides.shape)
    if sides[t, f] < -1e-9 * size[t] ** 2:
        raise ParameterError(
            "corners", "a polygon that keeps its shape", f"triangle {f} turned over at moment {t}",
            "use a Mesh, which may bend",
        )  # fmt: skip
    return faces


def _flatten(points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return coordinates in the plane, counter-clockwise about the normal."""
    axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.asarray(np.cross(normal, axis), dtype=np.float64)
    x /= np.linalg.norm(x)
    y = np.asarray(np.cross(normal, x), dtype=np.float64)
    return np.stack([points @ x, points @ y], axis=1)


def _turn(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _crossing_edges(p: NDArray[np.float64]) -> tuple[int, int] | None:
    n = len(p)
    for i in range(n):
        a, b = p[i], p[(i + 1) % n]
        for j in range(i + 2, n - (i == 0)):
            c, d = p[j], p[(j + 1) % n]
            if _turn(a, b, c) * _turn(a, b, d) < 0 and _turn(c, d, a) * _turn(c, d, b) < 0:
                return i, j
    return None


def _clip_ears(p: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    left = list(range(len(p)))
    faces: list[tuple[int, int, int]] = []
    while len(left) > 3:
        # The ear with the sharpest corner is cut first, which delays slivers.
        best, best_turn = -1, -1.0
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            turn = _turn(p[i], p[j], p[m])
            others = (q for q in left if q not in (i, j, m))
            if turn >= 0 and not any(_inside(p, i, j, m, q) for q in others):
                size = np.linalg.norm(p[j] - p[i]) * np.linalg.norm(p[m] - p[j])
                sharpness = turn / float(size) if size > 0 else 0.0
                if sharpness > best_turn:
                    best, best_turn = k, sharpness
        if best < 0:
            raise ParameterError(
                "corners", "a simple polygon", "one that touches or crosses itself"
            )
        i, j, m = left[best - 1], left[best], left[(best + 1) % len(left)]
        if best_turn > 0:
            faces.append((i, j, m))
        del left[best]
    faces.append((left[0], left[1], left[2]))
    return faces


def _inside(p: NDArray[np.float64], i: int, j: int, m: int, q: int) -> bool:
    """Whether corner q lies in the triangle, or on its new edge from m to i."""
    on_edges = _turn(p[i], p[j], p[q]) > 0 and _turn(p[j], p[m], p[q]) > 0
    return on_edges and _turn(p[m], p[i], p[q]) >= 0
