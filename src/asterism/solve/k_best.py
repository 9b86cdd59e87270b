"""The k best assignments, in order: what the best pairing is, and what it might be instead."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.checks import check_array, check_number
from asterism.errors import ParameterError, SolverLimit
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["KBestAssignments", "k_best_assignments"]

_LARGEST = 8192
_GREATEST_GAIN = 1e100


@record(eq=False)
class KBestAssignments:
    """What `k_best_assignments` found.

    Attributes
    ----------
    matches : ndarray of int, shape (K, n)
        Column of each row in each pairing, -1 where the row stays alone; the best pairing first.
        K is less than k where there are no more.
    totals : ndarray, shape (K,)
        Sum of gains of each pairing, falling.
    """

    matches: NDArray[np.int64]
    totals: NDArray[np.float64]


def k_best_assignments(gains: ArrayLike, k: int, *, complete: bool = False) -> KBestAssignments:
    """Rank the pairings of n rows with m columns by their sum of gains.

    A pairing gives every row one column or none, and no column to two rows. Murty's partition [1]_
    with the improvements of [2]_: a subproblem starts from the duals of the one it is part of,
    takes one shortest augmenting path, and is solved when its lower bound comes to the front.

    Parameters
    ----------
    gains : array_like, shape (n, m)
        Gain of each pair; -inf where it is forbidden.
    k : int
        So many pairings, where there are as many.
    complete : bool
        Whether every row must have a column. Otherwise a row may stay alone, for a gain of 0.

    Returns
    -------
    KBestAssignments
        Pairings of equal sums come in an order that depends on the gains alone.

    Raises
    ------
    ParameterError
        If a gain is NaN, +inf or beyond ±1e100, or `k` is below 1.
    SolverLimit
        If there are more than 8192 rows and columns together.

    References
    ----------
    .. [1] K. G. Murty: An algorithm for ranking all the assignments in order of increasing cost.
       Operations Research 16, 1968.
    .. [2] M. L. Miller, H. S. Stone, I. J. Cox: Optimizing Murty's ranked assignment method. IEEE
       Transactions on Aerospace and Electronic Systems 33, 1997.

    Examples
    --------
    >>> found = k_best_assignments([[3.0, 2.0], [2.5, -1.0]], 3)
    >>> found.matches
    array([[ 1,  0],
           [ 0, -1],
           [-1,  0]])
    >>> found.totals
    array([4.5, 3. , 2.5])
    """
    check_number("k", k, above=1, closed=True, integer=True)
    g = check_array("gains", gains, ("n", "m"), finite=False)
    fits = (np.abs(g) <= _GREATEST_GAIN) | np.isneginf(g)  # False for NaN too
    if not fits.all():
        place = tuple(int(i) for i in np.argwhere(~fits)[0])
        expected = f"numbers of at most {_GREATEST_GAIN:g} in size, or -inf"
        raise ParameterError("gains", expected, f"{g[place]} at index {place}")
    n, m = g.shape
    if n + m > _LARGEST:
        raise SolverLimit(
            "rows and columns", n + m, _LARGEST, "solve groups that share nothing apart"
        )
    if complete and n > m:
        found = np.empty((0, n), dtype=np.int32)
    elif complete:
        found = _engine.k_best(np.ascontiguousarray(-g), int(k))
    else:
        # A column for each row to be alone in.
        cost = np.full((n, m + n), np.inf)
        cost[:, :m] = -g
        cost[np.arange(n), m + np.arange(n)] = 0.0
        found = _engine.k_best(cost, int(k))
    matches = np.where(found < m, found, -1).astype(np.int64)
    won = np.concatenate([g, np.zeros((n, 1))], axis=1)  # alone is -1, the last
    return KBestAssignments(matches=matches, totals=won[np.arange(n), matches].sum(axis=1))
