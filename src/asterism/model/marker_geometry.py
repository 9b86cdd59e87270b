"""Geometry of marker sets: distances of a pose, and heights of a marker over three others."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "candidate_quads",
    "choose_quads",
    "heights",
    "pose_distances",
    "quad_sizes",
    "sides_of",
    "steady_quads",
]

NEIGHBOURS = 6
"""Number of neighbours of a marker whose triples may span its reference plane."""
STEADY = 0.1
"""Share of a distance that is added to its movement where neighbours are ordered."""
MAX_QUADS = 8
"""Number of reference planes of a marker."""
MIN_RATIO = 0.8
"""Smallest height as a multiple of its spread: the side of the plane is then certain."""
NOISE = 0.01
"""Error of a height that is always possible, metres, because markers are attached by hand."""
COMPACT = 0.05
"""Size at which a reference plane counts half as much as one without extent, metres."""


def pose_distances(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances between all markers of a pose, (M, M), NaN where a place is unknown."""
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    np.fill_diagonal(distances, 0.0)
    return distances


def heights(points: NDArray[np.float64], quads: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the signed heights of markers over the planes of three others, right-handed.

    Parameters
    ----------
    points : ndarray of shape (..., M, 3)
        Positions, metres, NaN where unknown.
    quads : ndarray of int, shape (Q, 4)
        A marker and its three references.

    Returns
    -------
    ndarray of shape (..., Q)
        Metres; NaN where a position is unknown or the references lie on a line.
    """
    x, a, b, c = (points[..., quads[:, i], :] for i in range(4))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return ((x - a) * normal).sum(axis=-1) / length


def candidate_quads(cost: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return each marker with all triples of its nearest neighbours, shape (Q, 4).

    Parameters
    ----------
    cost : ndarray of shape (M, M)
        Order of the neighbours, smallest first; infinite for pairs that are not to be used.
    """
    quads: list[tuple[int, ...]] = []
    for marker, row in enumerate(cost):
        nearest = np.argsort(row, kind="stable")[:NEIGHBOURS]
        nearest = nearest[np.isfinite(row[nearest])]
        quads += [(marker, *triple) for triple in combinations(nearest.tolist(), 3)]
    return np.array(quads, dtype=np.int64).reshape(-1, 4)


def steady_quads(
    distances: NDArray[np.float64], movements: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return each marker with all triples of its steadiest neighbours, shape (Q, 4).

    Parameters
    ----------
    distances, movements : ndarray of shape (M, M)
        Distances and their variation by movement, metres, NaN where unknown.
    """
    cost = np.nan_to_num(movements) + STEADY * distances
    cost[np.isnan(distances) | np.eye(len(distances), dtype=bool)] = np.inf
    return candidate_quads(cost)


def quad_sizes(quads: NDArray[np.int64], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest distance within each quad, metres, shape (Q,)."""
    if not len(quads):
        return np.zeros(0)
    pairs = combinations(range(4), 2)
    return np.max([distances[quads[:, i], quads[:, j]] for i, j in pairs], axis=0)


def choose_quads(
    quads: NDArray[np.int64],
    middle: NDArray[np.float64],
    spread: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Choose the quads that tell most certainly on which side of its references a marker lies.

    Parameters
    ----------
    quads : ndarray of int, shape (Q, 4)
        Candidates, ordered by marker.
    middle, spread : ndarray of shape (Q,)
        Mean and standard deviation of the heights, metres; an unknown spread is 0.
    distances : ndarray of shape (M, M)
        Distances of the markers; compact quads are preferred, because segments are rigid.

    Returns
    -------
    ndarray of int
        Indices of at most `MAX_QUADS` quads for each marker.
    """
    certainty = np.abs(middle) / (spread + NOISE)
    rank = np.nan_to_num(certainty / (COMPACT + quad_sizes(quads, distances)), nan=-1.0)
    chosen: list[int] = []
    for marker in np.unique(quads[:, 0]):
        own = np.flatnonzero(quads[:, 0] == marker)
        best = own[np.argsort(-rank[own], kind="stable")[:MAX_QUADS]]
        chosen += [int(q) for q in best if certainty[q] > MIN_RATIO]
    return np.array(chosen, dtype=np.int64)


def sides_of(
    quads: NDArray[np.int64],
    middle: NDArray[np.float64],
    spread: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> dict[str, Any]:
    """Return the chosen quads with their heights and spreads, as fields of a `MarkerSet`.

    Parameters
    ----------
    quads, middle, spread, distances
        As for `choose_quads`; an unknown spread may be NaN.
    """
    chosen = choose_quads(quads, middle, np.nan_to_num(spread), distances)
    return {
        "quads": quads[chosen],
        "heights": middle[chosen],
        "height_spreads": spread[chosen],
    }
