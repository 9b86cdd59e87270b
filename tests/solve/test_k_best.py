"""The k best assignments: Murty's ranking against every pairing, sorted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import asterism as am
from tests.references.assignment import every_choice


def every_pairing(gains: np.ndarray, *, complete: bool):
    """All pairings with their sums, the best first."""
    options = [
        [*([] if complete else [-1]), *np.flatnonzero(row > -np.inf).tolist()] for row in gains
    ]
    found = [
        (sum(gains[i, j] for i, j in enumerate(choice) if j >= 0), choice)
        for choice in every_choice(options)
    ]
    return sorted(found, key=lambda pair: -pair[0])


def check(gains: np.ndarray, k: int, *, complete: bool) -> None:
    found = am.solve.k_best_assignments(gains, k, complete=complete)
    wanted = every_pairing(gains, complete=complete)
    assert len(found.matches) == min(k, len(wanted))
    assert np.allclose(found.totals, [t for t, _ in wanted[:k]], rtol=0, atol=1e-9)
    matches = [tuple(row) for row in found.matches.tolist()]
    assert len(set(matches)) == len(matches)
    sums = {choice: total for total, choice in wanted}
    assert np.allclose([sums[match] for match in matches], found.totals, rtol=0, atol=1e-9)


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_equals_sorted_enumeration(seed, complete):
    rng = np.random.default_rng(seed)
    for _ in range(150):
        n, m = rng.integers(0, 5, 2)
        gains = rng.normal(0, 3, (n, m))
        if rng.random() < 0.4:
            gains = np.round(gains)  # ties
        gains[rng.random((n, m)) < rng.choice([0, 0.3, 0.7])] = -np.inf
        check(gains, int(rng.choice([1, 3, 20, 1000])), complete=complete)


def test_all_alike():
    # Every pairing of the same sum is one of them, and each comes once.
    found = am.solve.k_best_assignments(np.zeros((3, 3)), 100)
    assert len(found.matches) == 34  # 1 + 9 + 18 + 6
    assert len(am.solve.k_best_assignments(np.zeros((4, 4)), 100, complete=True).matches) == 24


@pytest.mark.parametrize("n", [20, 60])
def test_the_first_is_the_best_and_the_others_follow(n):
    rng = np.random.default_rng(n)
    gains = rng.normal(0, 5, (n, n + 3))
    found = am.solve.k_best_assignments(gains, 200, complete=True)
    rows, columns = linear_sum_assignment(-gains)
    assert found.totals[0] == pytest.approx(gains[rows, columns].sum(), rel=1e-12)
    assert (np.diff(found.totals) <= 1e-9).all()
    assert len({tuple(row) for row in found.matches.tolist()}) == 200
    # The second differs from the first in some row's column: try every such row.
    second = -np.inf
    for i in range(n):
        other = gains.copy()
        other[i, columns[i]] = -1e6
        r, c = linear_sum_assignment(-other)
        second = max(second, gains[r, c].sum())
    assert found.totals[1] == pytest.approx(second, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12))
def test_the_order_of_rows_and_columns_does_not_matter(seed, n, m):
    rng = np.random.default_rng(seed)
    gains = rng.normal(0, 2, (n, m))
    rows, columns = rng.permutation(n), rng.permutation(m)
    a = am.solve.k_best_assignments(gains, 30).totals
    b = am.solve.k_best_assignments(gains[rows][:, columns], 30).totals
    assert np.allclose(a, b, rtol=0, atol=1e-9)


def test_the_same_bytes_every_time():
    gains = np.round(np.random.default_rng(3).normal(0, 2, (12, 12)))
    a, b = (am.solve.k_best_assignments(gains, 50).matches for _ in range(2))
    assert (a == b).all()


@pytest.mark.parametrize(
    ("gains", "k", "message"),
    [
        ([[np.nan]], 1, "gains"),
        ([[np.inf]], 1, "gains"),
        ([[1e101]], 1, "gains"),
        ([1.0], 1, "gains"),
        ([[1.0]], 0, "k"),
        ([[1.0]], 1.5, "k"),
    ],
)
def test_bad_input_is_refused_by_name(gains, k, message):
    with pytest.raises(am.ParameterError, match=message):
        am.solve.k_best_assignments(gains, k)


def test_nothing_and_too_much():
    assert am.solve.k_best_assignments(np.empty((0, 3)), 5).matches.shape == (1, 0)
    assert am.solve.k_best_assignments(np.empty((2, 0)), 5).matches.tolist() == [[-1, -1]]
    assert len(am.solve.k_best_assignments(np.empty((2, 0)), 5, complete=True).matches) == 0
    with pytest.raises(am.SolverLimit, match="8192"):
        am.solve.k_best_assignments(np.zeros((5000, 5000)), 1)
