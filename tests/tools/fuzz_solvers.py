"""Feed random problems, most of them sparse, to every solver, and check each answer.

    python -m tests.tools.fuzz_solvers                      # 20 000 problems for each solver
    python -m tests.tools.fuzz_solvers k_best --count 1000000 --state /tmp/fuzz

Each answer must be feasible, no better than its bound, and optimal where a slower solver or a
simple condition decides. `fuzzing.py` runs the problems.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from asterism import _engine
from asterism.errors import SolverLimit
from asterism.solve import assign_multidimensional, joint_marginals, k_best_assignments
from tests.tools import fuzzing

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

SCALES = (1e-300, 1e-9, 1.0, 30.0, 1e6, 1e90)


def _size(rng: np.random.Generator) -> int:
    """Draw a size: small mostly, now and then some dozens, seldom hundreds."""
    largest = rng.choice([4, 12, 40, 120], p=[0.5, 0.39, 0.1, 0.01])
    return int(rng.integers(0, largest + 1))


def _matrix(rng: np.random.Generator, *, excluded: float) -> NDArray[np.float64]:
    """Draw pairs: sparse or full, in blocks or bands, with ties, of any scale."""
    n, m = _size(rng), _size(rng)
    gains = rng.normal(rng.choice([-1, 0, 1]), 1, (n, m))
    if rng.random() < 0.3:  # ties
        gains = np.round(gains)
    if rng.random() < 0.2:
        gains *= rng.choice(SCALES)
    share = rng.random() if rng.random() < 0.3 else min(1, rng.exponential(3) / max(n, m, 1))
    kept = rng.random((n, m)) < share
    if rng.random() < 0.3 and n and m:  # neighbours compete
        i, j = np.arange(n)[:, None] * m / n, np.arange(m)
        kept |= np.abs(i - j) < rng.integers(1, 4)
    gains[~kept] = excluded
    return gains


def _best(gains: NDArray[np.float64]) -> float:
    """Return the greatest sum of gains where every row may stay alone."""
    n, m = gains.shape
    padded = np.zeros((n, m + n))
    padded[:, :m] = np.where(np.isfinite(gains), np.maximum(gains, 0), 0)
    return float(padded[linear_sum_assignment(padded, maximize=True)].sum())


def _is_close(a: float, b: float, scale: float) -> bool:
    return abs(a - b) <= 1e-9 * max(scale, abs(b))


def _check_match(match: NDArray[np.integer], gains: NDArray[np.float64]) -> float:
    i = np.flatnonzero(match >= 0)
    assert len(np.unique(match[i])) == len(i)
    assert np.isfinite(gains[i, match[i]]).all()
    return float(gains[i, match[i]].sum())


def _assign(rng: np.random.Generator) -> None:
    gains = _matrix(rng, excluded=-np.inf)
    rows, columns = np.nonzero(np.isfinite(gains))
    pairs = rows.astype(np.int32), columns.astype(np.int32), gains[rows, columns]
    total = _check_match(_engine.assign(*gains.shape, *pairs), gains)
    assert _is_close(total, _best(gains), np.abs(pairs[2]).max(initial=0))


def _marry(rng: np.random.Generator) -> None:
    costs = _matrix(rng, excluded=np.inf)
    n, m = costs.shape
    lists = [rng.permutation(np.flatnonzero(np.isfinite(row))) for row in costs]
    first = np.concatenate([[0], np.cumsum([len(wishes) for wishes in lists])]).astype(np.int64)
    receivers = np.concatenate([np.empty(0, int), *lists]).astype(np.int32)
    listed = np.concatenate([np.empty(0), *(row[w] for row, w in zip(costs, lists, strict=True))])
    match, _ = _engine.marry(first, receivers, listed, m)
    _check_match(match, costs)
    rank = np.full((n, m), len(receivers))  # of a receiver for a proposer, then of being alone
    for p, wishes in enumerate(lists):
        rank[p, wishes] = np.arange(len(wishes))
    own_rank = np.array([rank[p, r] if r >= 0 else len(receivers) for p, r in enumerate(match)])
    own_cost = np.full(m, np.inf)
    own_cost[match[match >= 0]] = costs[np.flatnonzero(match >= 0), match[match >= 0]]
    better = (rank < own_rank.reshape(n, 1)) & (costs < own_cost) & np.isfinite(costs)
    assert not better.any(), "a pair that blocks the marriage"


def _k_best(rng: np.random.Generator) -> None:
    gains = _matrix(rng, excluded=-np.inf)
    is_complete = bool(rng.random() < 0.2)
    found = k_best_assignments(gains, int(rng.choice([1, 2, 7, 40])), complete=is_complete)
    finite = np.abs(gains[np.isfinite(gains)])
    scale = finite.max(initial=0) * max(gains.shape, default=1)
    assert (np.diff(found.totals) <= 1e-9 * scale).all()
    assert len({row.tobytes() for row in found.matches}) == len(found.matches)
    for match, total in zip(found.matches, found.totals, strict=True):
        assert _is_close(_check_match(match, gains), total, scale)
        assert not is_complete or (match >= 0).all()
    if not is_complete:
        assert _is_close(found.totals[0], _best(gains), scale)


def _joint(rng: np.random.Generator) -> None:
    weights = _matrix(rng, excluded=-np.inf)
    log_miss = rng.normal(0, rng.choice([0.1, 3.0, 100.0]), len(weights))
    max_states = int(rng.choice([1, 4, 64, 1024]))
    try:
        found = joint_marginals(weights, log_miss, max_states=max_states)
    except SolverLimit:
        return
    beta = found.marginals
    assert (beta >= 0).all()
    assert (beta <= 1 + 1e-9).all()
    assert not beta[:, :-1][~np.isfinite(weights)].any()
    assert abs(beta.sum(axis=1) - 1).max(initial=0) < 1e-9
    assert beta[:, :-1].sum(axis=0).max(initial=0) <= 1 + 1e-9


def _pack(rng: np.random.Generator) -> None:
    n_trees, n_resources = _size(rng), max(_size(rng), 1)
    sizes = rng.integers(1, 8, n_trees)
    worths = rng.normal(1, 3, sizes.sum())
    if rng.random() < 0.3:
        worths = np.round(worths)
    n_uses = np.minimum(rng.integers(0, 5, len(worths)), n_resources)
    firsts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    n_uses[firsts[:-1]] = 0  # every tree has an option that is free
    uses = [rng.choice(n_resources, n, replace=False) for n in n_uses]
    first_use = np.concatenate([[0], np.cumsum(n_uses)]).astype(np.int64)
    used = np.concatenate([np.empty(0, int), *uses]).astype(np.int32)
    problem = firsts, worths, first_use, used
    chosen, totals, is_exact, bound, _ = _engine.pack(
        *problem, int(rng.choice([1, 3, 20])), 50.0, 300
    )
    slack = 1e-9 * max(np.abs(worths).sum(), 1)
    assert len(totals) > 0
    assert (np.diff(totals) <= slack).all()
    assert totals[0] <= bound + slack
    assert not is_exact or abs(totals[0] - bound) <= slack
    for choice, total in zip(chosen, totals, strict=True):
        options = firsts[:-1] + choice
        taken = np.concatenate([np.empty(0, int), *(uses[o] for o in options)])
        assert len(np.unique(taken)) == len(taken)
        assert abs(worths[options].sum() - total) <= slack
    limit, losses = _engine.packing_losses(*problem)
    assert (losses >= -slack).all()
    best = firsts[:-1] + chosen[0]
    assert totals[0] <= limit - losses[best].max(initial=0) + slack


def _multidimensional(rng: np.random.Generator) -> None:
    n_dimensions, n_indices = int(rng.integers(2, 6)), max(_size(rng), 1)
    n_tuples = int(rng.integers(0, 4 * n_indices))
    tuples = rng.integers(-1, n_indices, (n_tuples, n_dimensions))
    tuples = tuples[(tuples >= 0).any(axis=1)]
    weights = rng.normal(1, 1, len(tuples))
    if rng.random() < 0.3:
        weights = np.round(weights)
    # Exact solutions are NP-hard: of small problems alone.
    method = "exact" if len(tuples) < 40 and rng.random() < 0.03 else "relaxed"
    found = assign_multidimensional(tuples, weights, method=method, max_rounds=10)
    for dimension in tuples[found.chosen].T:
        taken = dimension[dimension >= 0]
        assert len(np.unique(taken)) == len(taken)
    scale = max(np.abs(weights).sum(), 1)
    assert _is_close(weights[found.chosen].sum(), found.value, scale)
    assert found.value <= found.bound + 2e-6 * scale


SOLVERS: dict[str, Callable[[np.random.Generator], None]] = {
    "assign": _assign,
    "marry": _marry,
    "k_best": _k_best,
    "joint": _joint,
    "pack": _pack,
    "multidimensional": _multidimensional,
}


class Problems:
    """The problems of one solver, by number."""

    def __init__(self, name: str, _: Path, seed: int) -> None:
        self.solve, self.key = SOLVERS[name], [*name.encode(), seed]

    def prepare(self) -> None:
        """Solve some problems, which loads all modules."""
        for i in range(20):
            self.feed(*self.damaged(i))

    def damaged(self, i: int) -> tuple[np.random.Generator]:
        """Return the generator from which problem `i` is drawn."""
        return (np.random.default_rng([*self.key, i]),)

    def feed(self, rng: np.random.Generator) -> str:
        """Draw one problem, solve it and check the answer."""
        self.solve(rng)
        return "accepted"

    def kept(self, _: tuple[np.random.Generator]) -> tuple[str, bytes]:
        """Name and content of a file that repeats the problem: its number is enough."""
        return "seed.txt", repr(self.key).encode()


if __name__ == "__main__":
    sys.exit(fuzzing.main(__doc__, Problems, list(SOLVERS), ["-m", __spec__.name]))
