"""Visits of a chain against the enumerated posterior."""

from __future__ import annotations

import numpy as np

from tests.references.chain_moves import as_partition
from tests.references.partitions import every_partition


def total_variation(d, model, chain, n, *, settled=None):
    """Distance of what a chain visits and the enumerated posterior."""
    partitions, totals = every_partition(d, model)
    p = np.exp(totals - totals.max())
    if settled is not None:
        frozen, labels = settled
        p *= [agrees(d, tracks, as_partition(labels), frozen) for tracks in partitions]
    p /= p.sum()
    wanted = {frozenset(tracks): q for tracks, q in zip(partitions, p, strict=True)}
    labels, counts = chain.visits(n)
    found = dict.fromkeys(wanted, 0.0)
    for one, count in zip(labels, counts, strict=True):
        found[as_partition(one)] += count / n
    assert all(wanted[w] > 0 for w, q in found.items() if q > 0)
    return 0.5 * sum(abs(wanted[w] - found[w]) for w in wanted), int((p > 0).sum())


def agrees(d, tracks, settled, frozen):
    """Whether a partition has the same tracks as `settled` in the settled frames."""

    def heads(w):
        cut = {tuple(i for i in t if d.frame_of[i] <= frozen) for t in w}
        return cut - {()}

    return heads(tracks) == heads(settled)
