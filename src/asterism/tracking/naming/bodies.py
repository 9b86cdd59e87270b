"""Bodies: groups of tracks that are linked by distances that hardly vary."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.rigidity.distances import distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["bodies_of_sets", "linked_bodies", "parted_bodies"]

MAX_SPREAD, MAX_DISTANCE = 0.06, 0.6
"""Largest spread and largest distance of two tracks that are linked, metres. Across a joint both
are smaller."""
MIN_FRAMES = 3
"""Smallest number of common frames of two tracks that are linked."""
MIN_TRACKS = 4
"""Smallest number of tracks of a body."""
STEADINESS, LOOSEST = 10.0, 100.0
"""Weight of a distance's spread beside the distance itself, and the cost of an unknown one."""
MIN_SHARE = 0.7
"""Smallest body, as a share of one of equal bodies."""
TEMPERATURE = 12.0
"""Factor by which the difference of the scores of two subjects is too large: all distances of a
subject vary together."""


def parted_bodies(positions: NDArray[np.float64], n_subjects: int) -> list[NDArray[np.int64]]:
    """Return bodies that move close to each other in step, parted at their weakest links.

    Parameters
    ----------
    positions : ndarray of shape (F, n, 3)
        Positions of n tracks, metres, NaN without a detection.
    n_subjects : int
        Number of bodies.

    Returns
    -------
    list of ndarray
        Tracks of each body: those on one side of a link of the tree of steadiest, shortest
        distances. The weakest link is cut that leaves both sides large enough.
    """
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    found = distances_between(positions)
    cost = np.nan_to_num(found.middle, nan=LOOSEST) + STEADINESS * np.nan_to_num(
        found.spread, nan=LOOSEST
    )
    cost[found.n_frames < MIN_FRAMES] = LOOSEST
    np.fill_diagonal(cost, 0.0)
    tree = minimum_spanning_tree(cost).tolil()
    smallest = MIN_SHARE * len(cost) / n_subjects
    rows, columns = tree.nonzero()
    for k in np.argsort(-cost[rows, columns], kind="stable"):
        edge = int(rows[k]), int(columns[k])
        kept = tree[edge]
        tree[edge] = 0
        n, body = connected_components(tree, directed=False)
        sizes = np.bincount(body)
        if sizes[body[list(edge)]].min() < smallest:
            tree[edge] = kept
        elif n == n_subjects:
            return [np.flatnonzero(body == b) for b in range(n)]
    return []


def linked_bodies(positions: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Return groups of tracks that are linked by distances that hardly vary, the largest first.

    Parameters
    ----------
    positions : ndarray of shape (F, n, 3)
        Positions of n tracks, metres, NaN without a detection.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    found = distances_between(positions)
    linked = (found.n_frames >= MIN_FRAMES) & (found.spread < MAX_SPREAD)
    linked &= np.nan_to_num(found.middle, nan=np.inf) < MAX_DISTANCE
    n, component = connected_components(csr_matrix(linked), directed=False)
    bodies = [np.flatnonzero(component == c) for c in range(n)]
    bodies = [body for body in bodies if len(body) >= MIN_TRACKS]
    return sorted(bodies, key=lambda body: (-len(body), int(body[0])))


def bodies_of_sets(
    scores: dict[tuple[int, int], float], n_sets: int, n_bodies: int
) -> tuple[list[int], list[float]]:
    """Give each marker set a body of its own, by the largest sum of scores.

    Parameters
    ----------
    scores : dict
        Score of a set (first of the key) on a body (second), for those that fit.
    n_sets, n_bodies : int
        Numbers of sets and bodies.

    Returns
    -------
    bodies : list of int
        Body of each set, -1 for none.
    probabilities : list of float
        Probability of it, against the exchange of two sets.
    """
    from scipy.optimize import linear_sum_assignment

    table = np.zeros((n_sets, n_bodies))
    for (s, b), score in scores.items():
        table[s, b] = max(score, 0.0)
    rows, columns = linear_sum_assignment(-table)
    bodies = [-1] * n_sets
    for s, b in zip(rows.tolist(), columns.tolist(), strict=True):
        if table[s, b] > 0:
            bodies[s] = b
    probabilities = [1.0] * n_sets
    for s, b in enumerate(bodies):
        odds = [
            table[s, c] + table[t, b] - table[s, b] - table[t, c]
            for t, c in enumerate(bodies)
            if t != s and b >= 0 and c >= 0 and table[s, c] > 0 and table[t, b] > 0
        ]
        probabilities[s] = 1 / (1 + sum(float(np.exp(min(x / TEMPERATURE, 50.0))) for x in odds))
    return bodies, probabilities
