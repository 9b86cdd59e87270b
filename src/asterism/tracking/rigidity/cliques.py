"""Disjoint cliques of a graph: the markers of one rigid segment are joined pair by pair."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["disjoint_cliques"]


def disjoint_cliques(n: int, pairs: NDArray[np.int64]) -> tuple[tuple[int, ...], ...]:
    """Find cliques of at least three nodes, the largest first; a node is in one at most.

    Parameters
    ----------
    n : int
        Number of nodes.
    pairs : ndarray of int, shape (M, 2)
        Nodes that are joined.
    """
    friends: list[set[int]] = [set() for _ in range(n)]
    for i, j in pairs.tolist():
        friends[i].add(j)
        friends[j].add(i)
    found: list[tuple[int, ...]] = []
    while (largest := _largest_clique(friends)) is not None:
        found.append(largest)
        for i in largest:
            for j in friends[i]:
                friends[j].discard(i)
            friends[i] = set()
    return tuple(found)


def _largest_clique(friends: list[set[int]]) -> tuple[int, ...] | None:
    """Find the largest of the maximal cliques grown greedily from each pair, of at least three."""
    best: tuple[int, ...] | None = None
    for i in range(len(friends)):
        for j in sorted(friends[i]):
            if j < i or (best is not None and len(friends[i]) < len(best)):
                continue
            own, common = [i, j], friends[i] & friends[j]
            while common:  # the candidate that keeps the most others
                more = max(sorted(common), key=lambda k: len(common & friends[k]))
                own.append(more)
                common &= friends[more]
            if len(own) >= 3 and (best is None or len(own) > len(best)):
                best = tuple(sorted(own))
    return best
