"""Axial multidimensional assignment: the best set of tuples without a shared index.

The problem occurs in tracking (each dimension is a frame) and in multi-view correspondence (each
dimension is a camera). A tuple takes one index in some of the dimensions and none in the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from asterism import _engine
from asterism.checks import check_array, check_fields, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["MultidimensionalAssignment", "assign_multidimensional"]


@record(eq=False)
class MultidimensionalAssignment:
    """Result of `assign_multidimensional`: the chosen tuples, their value and its bound.

    Attributes
    ----------
    chosen : ndarray of int, shape (K,)
        Indices of the chosen tuples, increasing; no two of them share an index.
    value : float
        Sum of their weights.
    bound : float
        Upper bound of the value of any choice.
    method : {"exact", "relaxed"}
        Solver that was used.
    rounds : int
        Number of rounds of the relaxation; 0 for the exact solver.

    Examples
    --------
    >>> found = assign_multidimensional([[0, 0], [0, 1]], [1.0, 2.0])
    >>> found.chosen, found.gap
    (array([1]), 0.0)
    """

    chosen: NDArray[np.int64]
    value: float
    bound: float
    method: Literal["exact", "relaxed"]
    rounds: int

    @property
    def gap(self) -> float:
        """``bound - value``, the largest amount by which another choice could be better."""
        return self.bound - self.value


def assign_multidimensional(
    tuples: ArrayLike,
    weights: ArrayLike,
    *,
    method: Literal["exact", "relaxed"] = "exact",
    max_rounds: int = 300,
) -> MultidimensionalAssignment:
    """Choose the tuples with the largest sum of weights that share no index of a dimension.

    With tuples ``c`` over S dimensions and their weights ``w_c``,

    ``max Σ w_c x_c,  Σ_{c: c_s = i} x_c ≤ 1 for each index i of each dimension s,  x_c ∈ {0, 1}``.

    An index in no chosen tuple is assigned to the dummy at weight 0. With two dimensions this is
    linear assignment; with three or more it is NP-hard. ``"exact"`` is solved by HiGHS, to 1e-6
    of the value. ``"relaxed"`` puts dual prices on the constraints of all dimensions but the two
    largest, solves the remaining assignment, and moves the prices along the subgradient [1]. Each
    round yields an upper bound and, after a repair, a feasible choice.

    Parameters
    ----------
    tuples : array_like of int, shape (C, S)
        Index in each dimension, -1 for none; each tuple has at least one index.
    weights : array_like of shape (C,)
        Weight of each tuple, relative to assigning its indices to the dummy.
    method : {"exact", "relaxed"}
        Solver: "exact" for the optimum, "relaxed" for a fast choice with a bound.
    max_rounds : int
        Largest number of rounds of the relaxation. More rounds tighten the bound.

    Returns
    -------
    MultidimensionalAssignment

    Raises
    ------
    ParameterError
        If the arrays do not fit each other, or a weight is not finite.

    References
    ----------
    1. S. Deb, M. Yeddanapudi, K. Pattipati, Y. Bar-Shalom: A generalized S-D assignment
       algorithm for multisensor-multitarget state estimation. IEEE Transactions on Aerospace and
       Electronic Systems 33, 1997.

    Examples
    --------
    Three frames; the second tuple has the largest weight, but the other two together exceed it.

    >>> found = assign_multidimensional([[0, 0, 0], [0, 1, 1], [1, 1, -1]], [2.0, 3.0, 2.0])
    >>> found.chosen, found.value, found.gap
    (array([0, 2]), 4.0, 0.0)
    """
    check_fields("method", [method], ("exact", "relaxed"))
    check_number("max_rounds", max_rounds, above=1, closed=True, integer=True)
    w = check_array("weights", weights, ("C",))
    t = check_array("tuples", tuples, (len(w), "S"), dtype=np.int64)
    if t.size and t.min() < -1:
        raise ParameterError("tuples", "indices from 0, or -1 for none", int(t.min()))
    if len(t) and not (t >= 0).any(axis=1).all():
        which = int(np.flatnonzero(~(t >= 0).any(axis=1))[0])
        raise ParameterError("tuples", "at least one index in each", f"none in tuple {which}")
    useful = np.flatnonzero(w > 0)
    if not len(useful):
        chosen, bound, rounds = useful, 0.0, 0
    elif method == "exact":
        chosen, bound, rounds = *_solve_exactly(t[useful], w[useful]), 0
    else:
        chosen, bound, rounds = _relax(t[useful], w[useful], int(max_rounds))
    value = float(w[useful[chosen]].sum()) if len(useful) else 0.0
    return MultidimensionalAssignment(
        chosen=np.sort(useful[chosen]) if len(useful) else useful,
        value=value,
        bound=max(bound, value),
        method=method,
        rounds=rounds,
    )


def _resources(tuples: NDArray[np.int64]) -> NDArray[np.int64]:
    """Assign consecutive numbers to the indices of all dimensions; -1 stays."""
    numbers = np.full(tuples.shape, -1)
    start = 0
    for s in range(tuples.shape[1]):
        taken = tuples[:, s] >= 0
        used, place = np.unique(tuples[taken, s], return_inverse=True)
        numbers[taken, s] = start + place
        start += len(used)
    return numbers


def _solve_exactly(
    tuples: NDArray[np.int64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.int64], float]:
    """Choose tuples that share no index directly, and solve the others by HiGHS."""
    from scipy.optimize import Bounds, LinearConstraint, milp
    from scipy.sparse import csr_array

    resources = _resources(tuples)
    which, dimension = np.nonzero(resources >= 0)
    taken = resources[which, dimension]
    counts = np.bincount(taken)
    entangled = np.zeros(len(tuples), dtype=bool)
    entangled[which[counts[taken] > 1]] = True
    alone = np.flatnonzero(~entangled)
    rest = np.flatnonzero(entangled)
    if not len(rest):
        return alone, float(weights.sum())
    inside = entangled[which]
    place = np.cumsum(entangled) - 1
    rows = taken[inside]
    matrix: Any = csr_array(
        (np.ones(len(rows)), (rows, place[which[inside]])), shape=(len(counts), len(rest))
    )
    found: Any = milp(
        -weights[rest],
        constraints=LinearConstraint(matrix[np.unique(rows)], ub=1.0),
        integrality=np.ones(len(rest)),
        bounds=Bounds(0, 1),
        options={"mip_rel_gap": 0.0},
    )
    if found.x is None:
        raise RuntimeError(f"HiGHS: {found.message}")  # a choice of nothing is always feasible
    chosen = np.concatenate([alone, rest[found.x > 0.5]])
    value = float(weights[chosen].sum())
    bound = float(weights[alone].sum() - found.mip_dual_bound)
    # HiGHS stops when the value is within 1e-6 of its bound.
    return chosen, value if bound - value < 1e-6 * max(1.0, abs(value)) else bound


def _relax(
    tuples: NDArray[np.int64], weights: NDArray[np.float64], max_rounds: int
) -> tuple[NDArray[np.int64], float, int]:
    """Solve by Lagrangian relaxation of all dimensions but two."""
    resources = _resources(tuples)
    sizes = [len(np.unique(column[column >= 0])) for column in tuples.T]
    a, b, *others = np.argsort(sizes, kind="stable")[::-1].tolist() + [-1] * (2 - len(sizes))
    plane = _Plane(resources[:, a], resources[:, b] if b >= 0 else np.full(len(tuples), -1))
    priced = resources[:, others]
    which, column = np.nonzero(priced >= 0)
    taken = priced[which, column]
    n = int(resources.max()) + 1
    is_priced = np.zeros(n, dtype=bool)
    is_priced[taken] = True
    prices = np.zeros(n)
    best = _repair(resources, weights, np.argsort(-weights, kind="stable"))
    value, bound = float(weights[best].sum()), np.inf
    step, since, rounds = 1.0, 0, 0
    while rounds < max_rounds:
        rounds += 1
        reduced = weights - np.bincount(which, weights=prices[taken], minlength=len(tuples))
        chosen = plane.solve(reduced)
        dual = float(reduced[chosen].sum() + prices.sum())
        since = 0 if dual < bound - 1e-12 * abs(dual) else since + 1
        bound = min(bound, dual)
        first = chosen[np.argsort(-reduced[chosen], kind="stable")]
        repaired = _repair(
            resources, weights, np.concatenate([first, np.argsort(-reduced, kind="stable")])
        )
        if weights[repaired].sum() > value:
            best, value = repaired, float(weights[repaired].sum())
        if bound - value <= 1e-9 * max(1.0, abs(value)):
            break
        is_chosen = np.zeros(len(tuples), dtype=bool)
        is_chosen[chosen] = True
        used = np.bincount(taken, weights=is_chosen[which].astype(np.float64), minlength=n)
        slope = np.where(is_priced, 1.0 - used, 0.0)
        slope[(prices == 0) & (slope > 0)] = 0.0
        length = float(slope @ slope)
        if length == 0:
            break
        if since >= 10:
            step, since = step / 2, 0
        if step < 1e-4:
            break
        prices = np.maximum(prices - step * (dual - value) / length * slope, 0.0)
    return best, bound, rounds


class _Plane:
    """Linear assignment of two dimensions, with the best tuple for each pair."""

    def __init__(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> None:
        self.free = np.flatnonzero((rows < 0) & (columns < 0))
        bound = np.flatnonzero((rows >= 0) | (columns >= 0))
        self.order = bound[np.lexsort((columns[bound], rows[bound]))]
        r, c = rows[self.order], columns[self.order]
        is_new = np.ones(len(r), dtype=bool)
        is_new[1:] = (np.diff(r) != 0) | (np.diff(c) != 0)
        self.starts = np.flatnonzero(is_new)
        self.row, self.column = r[self.starts], c[self.starts]
        self.n = int(max(rows.max(initial=-1), columns.max(initial=-1))) + 1

    def solve(self, reduced: NDArray[np.float64]) -> NDArray[np.int64]:
        chosen = [self.free[reduced[self.free] > 0]]
        if len(self.starts):
            ranked = reduced[self.order]
            highest = np.maximum.reduceat(ranked, self.starts)
            # Of equally good tuples of a pair, the first is used.
            pair = np.repeat(np.arange(len(highest)), np.diff(np.append(self.starts, len(ranked))))
            hits = np.flatnonzero(ranked == highest[pair])
            first = hits[np.unique(pair[hits], return_index=True)[1]]
            of_pair = self.order[first]
            row_alone, column_alone = np.zeros(self.n), np.zeros(self.n)
            has_no_column, has_no_row = self.column < 0, self.row < 0
            row_alone[self.row[has_no_column]] = np.maximum(highest[has_no_column], 0)
            column_alone[self.column[has_no_row]] = np.maximum(highest[has_no_row], 0)
            both = np.flatnonzero(~has_no_column & ~has_no_row)
            gains = highest[both] - row_alone[self.row[both]] - column_alone[self.column[both]]
            match = _engine.assign(
                self.n, self.n, self.row[both].astype(np.int32),
                self.column[both].astype(np.int32), gains,
            )  # fmt: skip
            taken = match[self.row[both]] == self.column[both]
            chosen.append(of_pair[both[taken]])
            is_matched = np.zeros(self.n, dtype=bool)
            is_matched[match[match >= 0]] = True
            left = has_no_column & (match[self.row] < 0) & (highest > 0)
            chosen.append(of_pair[left])
            left = has_no_row & ~is_matched[self.column] & (highest > 0)
            chosen.append(of_pair[left])
        return np.concatenate(chosen)


def _repair(
    resources: NDArray[np.int64], weights: NDArray[np.float64], order: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Choose tuples greedily in this order, then exchange one tuple for those that block it."""
    owner: dict[int, int] = {}
    lists = [[r for r in row if r >= 0] for row in resources.tolist()]
    w = weights.tolist()

    def add(c: int) -> None:
        for r in lists[c]:
            owner[r] = c

    for c in order.tolist():
        if not any(r in owner for r in lists[c]):
            add(c)
    for c in order.tolist():
        rivals = {owner[r] for r in lists[c] if r in owner}
        if c not in rivals and w[c] > sum(w[k] for k in rivals):
            for k in rivals:
                for r in lists[k]:
                    del owner[r]
            add(c)
    return np.array(sorted(set(owner.values())), dtype=np.int64)
