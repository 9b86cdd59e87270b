"""Disjoint cliques of a graph: the markers of one rigid segment are joined pair by pair."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

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
    friends = [0] * n  # of each node, a bit for each other one
    for i, j in pairs.tolist():
        friends[i] |= 1 << j
        friends[j] |= 1 << i
    found: list[tuple[int, ...]] = []
    while (largest := _largest_clique(friends)) is not None:
        found.append(largest)
        used = sum(1 << i for i in largest)
        friends = [0 if used >> i & 1 else own & ~used for i, own in enumerate(friends)]
    return tuple(found)


def _largest_clique(friends: list[int]) -> tuple[int, ...] | None:
    """Find the largest of the maximal cliques grown greedily from each pair, of at least three."""
    best: list[int] = []
    for i, own in enumerate(friends):
        for j in _nodes(own >> i << i):
            clique, common = [i, j], own & friends[j]
            # No clique that the candidates cannot make larger than the best is grown to its end.
            while common and len(clique) + common.bit_count() > len(best):
                # The candidate that keeps the most others, the first of equals.
                n_kept = {k: (common & friends[k]).bit_count() for k in _nodes(common)}
                more = max(n_kept, key=n_kept.__getitem__)
                clique.append(more)
                common &= friends[more]
            if not common and len(clique) >= 3 and len(clique) > len(best):
                best = clique
    return tuple(sorted(best)) or None


def _nodes(bits: int) -> Iterator[int]:
    """Yield the nodes whose bits are set, in increasing order."""
    while bits:
        yield (bits & -bits).bit_length() - 1
        bits &= bits - 1
