"""Best pairings and stable matchings by enumeration and by SciPy."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment


def every_choice(options: list[list[int]]) -> list[tuple[int, ...]]:
    """All ways to take one of its options for each row: -1 is for any number of rows."""
    found: list[tuple[int, ...]] = [()]
    for own in options:
        found = [(*taken, j) for taken in found for j in own if j < 0 or j not in taken]
    return found


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
    for partners in every_choice([[*wishes, -1] for wishes in lists]):
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
