"""The k best assignments in order of their total gain."""

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
_MAX_GAIN = 1e100


@record(eq=False)
class KBestAssignments:
    """Result of `k_best_assignments`: the best assignments and their totals.

    Attributes
    ----------
    matches : ndarray of int, shape (K, n)
        Column of each row in each assignment, -1 for an unassigned row; the best assignment
        first. K is less than k if fewer assignments exist.
    totals : ndarray of shape (K,)
        Total gain of each assignment, in decreasing order.

    Examples
    --------
    >>> k_best_assignments([[1.0, 0.5]], 2).totals
    array([1. , 0.5])
    """

    matches: NDArray[np.int64]
    totals: NDArray[np.float64]


def k_best_assignments(gains: ArrayLike, k: int, *, complete: bool = False) -> KBestAssignments:
    """Find the k assignments of n rows to m columns with the largest total gains.

    An assignment gives each row at most one column, and each column to at most one row. The
    algorithm is Murty's partition [1] with the improvements of [2]: a subproblem starts from the
    dual prices of its parent, takes one shortest augmenting path, and is solved when its bound
    comes to the front of the queue.

    Parameters
    ----------
    gains : array_like of shape (n, m)
        Gain of each pair; -inf for a forbidden pair.
    k : int
        Number of assignments to find, ≥ 1; fewer are returned if fewer exist.
    complete : bool
        Whether every row must have a column. Otherwise a row can stay unassigned, with a gain of
        0.

    Returns
    -------
    KBestAssignments
        Assignments with equal totals come in an order that depends on the gains alone.

    Raises
    ------
    ParameterError
        If a gain is NaN, +inf or beyond ±1e100, or `k` is below 1.
    SolverLimit
        If there are more than 8192 rows and columns together.

    References
    ----------
    1. K. G. Murty: An algorithm for ranking all the assignments in order of increasing cost.
       Operations Research 16, 1968.
    2. M. L. Miller, H. S. Stone, I. J. Cox: Optimizing Murty's ranked assignment method. IEEE
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
    fits = (np.abs(g) <= _MAX_GAIN) | np.isneginf(g)  # False for NaN too
    if not fits.all():
        place = tuple(int(i) for i in np.argwhere(~fits)[0])
        expected = f"numbers of at most {_MAX_GAIN:g} in size, or -inf"
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
        # Each row has a further column of its own, which stands for unassigned.
        cost = np.full((n, m + n), np.inf)
        cost[:, :m] = -g
        cost[np.arange(n), m + np.arange(n)] = 0.0
        found = _engine.k_best(cost, int(k))
    matches = np.where(found < m, found, -1).astype(np.int64)
    # The index -1 of an unassigned row addresses the last column.
    won = np.concatenate([g, np.zeros((n, 1))], axis=1)
    return KBestAssignments(matches=matches, totals=won[np.arange(n), matches].sum(axis=1))
