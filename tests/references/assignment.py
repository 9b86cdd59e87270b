"""Best pairings and stable matchings by enumeration and by SciPy."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import linear_sum_assignment


def best_pairing(gains: np.ndarray) -> float:
    """Greatest sum of gains over all partial pairings, by SciPy on a padded matrix."""
    n, m = gains.shape
    padded = np.zeros((n + m, n + m))
    padded[:n, :m] = -np.where(np.isfinite(gains), gains, -1e9)
    i, j = linear_sum_assignment(padded)
    return -padded[i, j].sum()


def stable_matchings(lists: list[list[int]], costs: dict[tuple[int, int], float], n_receivers: int):
    """All stable matchings by enumeration: a partner, or -1, of each proposer.

    `lists` rank the acceptable receivers of each proposer; `costs[p, r]` ranks p for r.
    """
    options = [[*wishes, -1] for wishes in lists]
    for partners in itertools.product(*options):
        taken = [r for r in partners if r >= 0]
        if len(set(taken)) < len(taken):
            continue
        holder = {r: p for p, r in enumerate(partners) if r >= 0}
        if not any(
            is_blocking(lists, costs, partners, holder, p, r)
            for p, wishes in enumerate(lists)
            for r in wishes
        ):
            yield partners


def is_blocking(lists, costs, partners, holder, p, r) -> bool:
    """Whether p and r would both rather have each other than what they have."""
    rank = lists[p].index
    if partners[p] >= 0 and rank(r) >= rank(partners[p]):
        return False
    if r not in holder:
        return True
    rival = holder[r]
    return rival != p and (costs[p, r], p) < (costs[rival, r], rival)
