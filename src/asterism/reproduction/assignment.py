"""§2.4: the assignment problem, its constraints, and what more dimensions change."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment, linprog

from asterism.reproduction.part import Claim, Outcome, Part, Table
from asterism.reproduction.rules import differs, exact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.reproduction.part import Effort, Tell

N_MINORS = 3  # all square submatrices for so many items
SIZES = (3, 4, 5)
TOLERANCE = 1e-7
DRAWS = 4  # a seed


def run(effort: Effort, tell: Tell) -> Outcome:
    """Take determinants of submatrices, and relax assignments of two and three dimensions."""
    matrix = constraints(N_MINORS, 2)
    found, n_minors = _determinants(matrix)
    odd = len(found - {-1, 0, 1})
    tell(0.3)
    listed = [sum(1 for _ in itertools.permutations(range(n))) for n in SIZES]
    wrong_counts = sum(a != math.factorial(n) for a, n in zip(listed, SIZES, strict=True))
    shares: dict[int, list[float]] = {2: [], 3: []}
    gap = 0.0
    rows: list[list[str]] = []
    for i, n in enumerate(SIZES):
        each: dict[int, list[float]] = {2: [], 3: []}
        for seed in range(DRAWS * effort.seeds):
            rng = np.random.default_rng((seed, n))
            for d in (2, 3):
                cost = rng.random((n,) * d)
                solution = linprog(
                    cost.ravel(), A_eq=constraints(n, d), b_eq=np.ones(d * n), method="highs-ds"
                )
                is_whole = np.abs(solution.x - np.rint(solution.x)).max() <= TOLERANCE
                each[d].append(100.0 * (not is_whole))
                if d == 2:
                    at = linear_sum_assignment(cost)
                    gap = max(gap, abs(float(cost[at].sum()) - solution.fun))
        for d in (2, 3):
            shares[d] += each[d]
        rows.append([str(n), str(math.factorial(n)), f"{np.mean(each[2]):.0f} %",
                     f"{math.factorial(n) ** 2:,}", f"{np.mean(each[3]):.0f} %"])  # fmt: skip
        tell(0.3 + 0.7 * (i + 1) / len(SIZES))
    claims = [
        Claim("assignments of n items", "n!", ", ".join(map(str, listed)),
              exact(wrong_counts, 0, "number of wrong counts", len(SIZES))),
        Claim("determinants of square submatrices of A", "+1, −1 or 0",
              ", ".join(f"{k:+d}".replace("-", "−") if k else "0" for k in sorted(found)),
              exact(odd, 0, "number of other values", n_minors)),
        Claim("so the relaxed problem has a whole solution", "total unimodularity",
              f"{np.mean(shares[2]):.0f} % are not whole",
              exact(float(np.max(shares[2])), 0, "greatest share that is not whole",
                    len(shares[2]))),
        Claim("… which costs what the exact solver finds", "an identity", f"differ by {gap:.1e}",
              exact(gap, TOLERANCE, "greatest difference", len(shares[2]))),
        Claim("with three dimensions it has not (NP-hard)", "Lagrangian relaxation is needed",
              f"{np.mean(shares[3]):.0f} % are not whole",
              differs(shares[2], shares[3], "in a hundred that are not whole", 1)),
    ]  # fmt: skip
    head = ["n", "assignments, 2 dimensions", "relaxed: not whole", "assignments, 3 dimensions",
            "relaxed: not whole"]  # fmt: skip
    return Outcome(
        claims=claims,
        tables=[Table("Random costs", head, rows)],
        notes=(
            "`am.MDA` solves the problem of several dimensions exactly (HiGHS) or by Lagrangian "
            "relaxation with its gap told.",
        ),
    )


def constraints(n: int, dimensions: int) -> NDArray[np.float64]:
    """Give the matrix of the assignment constraints, shape (dimensions · n, n ** dimensions)."""
    index = np.indices((n,) * dimensions).reshape(dimensions, -1)
    return np.vstack([index[d] == i for d in range(dimensions) for i in range(n)]).astype(float)


def _determinants(matrix: NDArray[np.float64]) -> tuple[set[int], int]:
    """Give all values of the determinants of square submatrices, and how many there are."""
    n_rows, n_columns = matrix.shape
    values: set[int] = set()
    count = 0
    for k in range(1, n_rows + 1):
        columns = list(itertools.combinations(range(n_columns), k))
        for rows in itertools.combinations(range(n_rows), k):
            minors = matrix[np.array(rows)][:, np.array(columns)].transpose(1, 0, 2)
            values |= set(np.rint(np.linalg.det(minors)).astype(int).tolist())
            count += len(columns)
    return values, count


PART = Part(
    title="The assignment problem",
    section="§2.4",
    covers="the assignment constraints and their matrix",
    did="States that there are n! assignments, that their constraints have a totally unimodular "
    "matrix, and that with more dimensions the problem is NP-hard and is relaxed.",
    run=run,
)
