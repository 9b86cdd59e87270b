"""Multidimensional assignment: exact against every choice; the relaxation between its bounds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import asterism as am


def best_by_hand(tuples: np.ndarray, weights: np.ndarray) -> float:
    """The best value, trying every set of tuples that share nothing."""

    def best(c: int, used: frozenset) -> float:
        if c == len(tuples):
            return 0.0
        without = best(c + 1, used)
        own = frozenset((s, int(i)) for s, i in enumerate(tuples[c]) if i >= 0)
        if own & used:
            return without
        return max(without, weights[c] + best(c + 1, used | own))

    return best(0, frozenset())


def random_problem(rng: np.random.Generator, n_tuples: int, n_dimensions: int, size: int):
    tuples = rng.integers(0, size, (n_tuples, n_dimensions))
    tuples[rng.random(tuples.shape) < 0.25] = -1
    tuples[~(tuples >= 0).any(axis=1), 0] = 0
    return tuples, rng.normal(1, 2, n_tuples)


def check_choice(tuples, weights, found) -> None:
    for s in range(tuples.shape[1]):
        taken = tuples[found.chosen, s]
        taken = taken[taken >= 0]
        assert len(set(taken.tolist())) == len(taken)
    assert found.value == pytest.approx(weights[found.chosen].sum(), abs=1e-12)
    assert found.gap >= 0


@pytest.mark.parametrize("seed", range(8))
def test_exact_is_the_best_of_all_and_the_relaxation_is_bounded(seed):
    rng = np.random.default_rng(seed)
    n_tight = 0
    for _ in range(60):
        n, S = int(rng.integers(0, 13)), int(rng.integers(1, 6))
        tuples, weights = random_problem(rng, n, S, int(rng.integers(1, 4)))
        wanted = best_by_hand(tuples, weights)
        exact = am.solve.assign_multidimensional(tuples, weights)
        relaxed = am.solve.assign_multidimensional(tuples, weights, method="relaxed")
        for found in (exact, relaxed):
            check_choice(tuples, weights, found)
        assert exact.value == pytest.approx(wanted, abs=1e-6)
        assert exact.gap == pytest.approx(0, abs=1e-6)
        assert relaxed.value <= wanted + 1e-9
        assert relaxed.bound >= wanted - 1e-9
        n_tight += relaxed.gap < 1e-6
    assert n_tight > 40  # most of these small ones close


@pytest.mark.parametrize("seed", range(4))
def test_two_dimensions_are_linear_assignment(seed):
    rng = np.random.default_rng(seed)
    gains = rng.normal(0, 3, (12, 15))
    i, j = (index.ravel() for index in np.indices(gains.shape))
    rows, columns = linear_sum_assignment(-np.maximum(gains, 0))
    wanted = np.maximum(gains, 0)[rows, columns].sum()
    for method in ("exact", "relaxed"):
        found = am.solve.assign_multidimensional(
            np.stack([i, j], axis=1), gains.ravel(), method=method
        )
        assert found.value == pytest.approx(wanted, abs=1e-6)
        assert found.gap == pytest.approx(0, abs=1e-6)


def tracks_over_scans(rng: np.random.Generator, n: int, S: int):
    """Gated tuples as a tracker makes them: points that wander, and all their near neighbours."""
    x = rng.uniform(0, 1, (n, 2))
    scans = []
    for _ in range(S):
        x = x + rng.normal(0, 0.01, x.shape)
        scans.append(x + rng.normal(0, 0.01, x.shape))
    tuples, weights = [], []
    near = [[np.flatnonzero(np.linalg.norm(scan - y, axis=1) < 0.08) for y in x] for scan in scans]
    for k in range(n):
        for choice in itertools.product(*(scan[k] for scan in near)):
            points = np.array([scans[s][j] for s, j in enumerate(choice)])
            tuples.append(choice)
            weights.append(12 - (np.diff(points, axis=0) ** 2).sum() / (4 * 0.01**2))
    return np.array(tuples), np.array(weights)


def test_a_problem_of_thousands_of_tuples_is_solved_and_bounded():
    tuples, weights = tracks_over_scans(np.random.default_rng(1), 80, 4)
    assert len(tuples) > 1000
    exact = am.solve.assign_multidimensional(tuples, weights)
    relaxed = am.solve.assign_multidimensional(tuples, weights, method="relaxed")
    for found in (exact, relaxed):
        check_choice(tuples, weights, found)
    assert relaxed.value <= exact.value + 1e-6 <= relaxed.bound + 2e-6
    assert relaxed.value > 0.97 * exact.value
    assert relaxed.bound < 1.03 * exact.value


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_neither_order_nor_numbering_matters(seed):
    rng = np.random.default_rng(seed)
    tuples, weights = random_problem(rng, 12, 3, 4)
    order, numbers = rng.permutation(12), rng.permutation(4)
    other = np.where(tuples >= 0, numbers[tuples], -1)[order][:, rng.permutation(3)]
    a = am.solve.assign_multidimensional(tuples, weights).value
    b = am.solve.assign_multidimensional(other, weights[order]).value
    assert a == pytest.approx(b, abs=1e-6)


def test_the_same_choice_every_time():
    tuples, weights = tracks_over_scans(np.random.default_rng(2), 20, 3)
    for method in ("exact", "relaxed"):
        a, b = (am.solve.assign_multidimensional(tuples, weights, method=method) for _ in range(2))
        assert (a.chosen == b.chosen).all()
        assert (a.value, a.bound, a.rounds) == (b.value, b.bound, b.rounds)


def test_nothing_to_choose():
    for method in ("exact", "relaxed"):
        none = am.solve.assign_multidimensional(np.empty((0, 3)), [], method=method)
        bad = am.solve.assign_multidimensional([[0, 1]], [-1.0], method=method)
        for found in (none, bad):
            assert (len(found.chosen), found.value, found.gap) == (0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("tuples", "weights", "options", "message"),
    [
        ([[0, 1]], [1.0, 2.0], {}, "tuples"),
        ([[0, -2]], [1.0], {}, "tuples"),
        ([[-1, -1]], [1.0], {}, "none in tuple 0"),
        ([[0.5, 1]], [1.0], {}, "tuples"),
        ([[0, 1]], [np.nan], {}, "weights"),
        ([[0, 1]], [1.0], {"method": "greedy"}, "method"),
        ([[0, 1]], [1.0], {"max_rounds": 0}, "max_rounds"),
    ],
)
def test_bad_input_is_refused_by_name(tuples, weights, options, message):
    with pytest.raises(am.ParameterError, match=message):
        am.solve.assign_multidimensional(tuples, weights, **options)
