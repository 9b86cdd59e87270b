"""§2.4: the assignment problem, its constraints, and what more dimensions change."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment, linprog

from asterism.reproduction.part import Outcome, Part, Table
from asterism.reproduction.rules import exact, fewer

if TYPE_CHECKING:
    from numpy.typing import NDArray

N_MINORS = 3  # all square submatrices for so many items
SIZES = (3, 4, 5)
TOLERANCE = 1e-7
DRAWS = 4  # a seed


def run(seeds: int) -> Outcome:
    """Take determinants of submatrices, and relax assignments of two and three dimensions."""
    determinants = _determinants(constraints(N_MINORS, 2))
    wrong_counts = sum(
        sum(1 for _ in itertools.permutations(range(n))) != math.factorial(n) for n in SIZES
    )
    fractional: dict[tuple[int, int], list[float]] = {}  # percent, by n and dimensions
    gap = 0.0
    for n in SIZES:
        for seed in range(DRAWS * seeds):
            rng = np.random.default_rng((seed, n))
            for d in (2, 3):
                cost = rng.random((n,) * d)
                solution = linprog(
                    cost.ravel(), A_eq=constraints(n, d), b_eq=np.ones(d * n), method="highs-ds"
                )
                is_whole = np.abs(solution.x - np.rint(solution.x)).max() <= TOLERANCE
                fractional.setdefault((n, d), []).append(100.0 * (not is_whole))
                if d == 2:
                    exact_cost = float(cost[linear_sum_assignment(cost)].sum())
                    gap = max(gap, abs(exact_cost - solution.fun))
    two, three = ([x for n in SIZES for x in fractional[n, d]] for d in (2, 3))
    claims = [
        exact("n items have n! assignments", "n!", wrong_counts, "number of wrong counts",
              len(SIZES)),
        exact("determinants of square submatrices of A", "+1, −1 or 0",
              int((~np.isin(determinants, (-1, 0, 1))).sum()), "number of other values",
              len(determinants)),
        exact("the relaxed problem of two dimensions has an integer solution",
              "total unimodularity", max(two), "greatest share of fractional solutions", len(two)),
        exact("the relaxed solution costs as much as the exact one", "an identity", gap,
              "greatest difference", len(two), TOLERANCE),
        fewer("three dimensions: the relaxed solution is fractional (NP-hard)",
              "Lagrangian relaxation is needed", two, three, "% of the solutions fractional", 1),
    ]  # fmt: skip
    rows = [
        [str(n), str(math.factorial(n)), f"{np.mean(fractional[n, 2]):.0f} %",
         f"{math.factorial(n) ** 2:,}", f"{np.mean(fractional[n, 3]):.0f} %"]
        for n in SIZES
    ]  # fmt: skip
    head = ["n", "assignments, 2 dimensions", "relaxed: fractional", "assignments, 3 dimensions",
            "relaxed: fractional"]  # fmt: skip
    return Outcome(claims=claims, tables=[Table("Random costs", head, rows)])


def constraints(n: int, dimensions: int) -> NDArray[np.float64]:
    """Return the matrix of the assignment constraints, shape (dimensions · n, n ** dimensions)."""
    index = np.indices((n,) * dimensions).reshape(dimensions, -1)
    return np.vstack([index[d] == i for d in range(dimensions) for i in range(n)]).astype(float)


def _determinants(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the determinants of all square submatrices, rounded to integers."""
    n_rows, n_columns = matrix.shape
    found: list[NDArray[np.float64]] = []
    for k in range(1, n_rows + 1):
        columns = np.array(list(itertools.combinations(range(n_columns), k)))
        for rows in itertools.combinations(range(n_rows), k):
            minors = matrix[np.array(rows)][:, columns].transpose(1, 0, 2)
            found.append(np.rint(np.linalg.det(minors)))
    return np.concatenate(found)


PART = Part(
    name="assignment",
    title="The assignment problem",
    section="§2.4",
    covers="the assignment constraints and their matrix",
    summary="States that there are n! assignments, that their constraints have a totally "
    "unimodular matrix, and that with more dimensions the problem is NP-hard and is relaxed.",
    run=run,
    notes=(
        "`am.MDA` solves the problem of several dimensions exactly (HiGHS) or by Lagrangian "
        "relaxation with its gap in `info`.",
    ),
)
