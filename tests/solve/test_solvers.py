"""The engine's combinatorial solvers against enumeration and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism import _engine
from tests.references.assignment import best_pairing, is_blocking, stable_matchings
from tests.solve.markets import marry, random_market
from tests.tools.fuzz_solvers import SOLVERS, Problems


def sparse(gains: np.ndarray):
    rows, columns = np.nonzero(np.isfinite(gains))
    return rows.astype(np.int32), columns.astype(np.int32), gains[rows, columns]


@pytest.mark.parametrize("seed", range(40))
def test_assignment_finds_the_greatest_sum(seed):
    rng = np.random.default_rng(seed)
    for _ in range(25):
        n, m = rng.integers(0, 13, 2)
        gains = rng.normal(0.3, 1, (n, m))
        if seed % 2:  # ties
            gains = np.round(gains, 1)
        gains[rng.random((n, m)) < rng.uniform(0, 0.8)] = np.inf
        match = _engine.assign(n, m, *sparse(gains))
        taken = match[match >= 0]
        assert len(np.unique(taken)) == len(taken)
        i = np.flatnonzero(match >= 0)
        assert np.isfinite(gains[i, match[i]]).all()
        finite = np.where(np.isfinite(gains), gains, -np.inf)
        assert gains[i, match[i]].sum() == pytest.approx(best_pairing(finite), abs=1e-9)


def test_assignment_of_one_large_group():
    rng = np.random.default_rng(7)
    gains = rng.gamma(2, 1, (300, 280))
    gains[rng.random(gains.shape) < 0.9] = np.inf
    match = _engine.assign(300, 280, *sparse(gains))
    i = np.flatnonzero(match >= 0)
    best = best_pairing(np.where(np.isfinite(gains), gains, -np.inf))
    assert gains[i, match[i]].sum() == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_marriage_is_stable_and_best_for_every_proposer(seed):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        n, m = rng.integers(1, 7, 2)
        lists, costs = random_market(rng, n, m, rng.uniform(0.4, 1.0), ties=bool(seed % 3 == 0))
        partners, _ = marry(lists, costs, m)
        stable = list(stable_matchings(lists, costs, m))
        assert tuple(partners) in stable
        for p, wishes in enumerate(lists):
            rank = [*wishes, -1].index
            assert rank(partners[p]) == min(rank(s[p]) for s in stable)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 40))
def test_no_pair_would_rather_have_each_other(seed, n, m):
    lists, costs = random_market(np.random.default_rng(seed), n, m, 0.5)
    partners, n_proposals = marry(lists, costs, m)
    holder = {int(r): p for p, r in enumerate(partners) if r >= 0}
    assert not any(
        is_blocking(lists, costs, partners, holder, p, r)
        for p, wishes in enumerate(lists)
        for r in wishes
    )
    assert n_proposals <= sum(map(len, lists)) <= n * m


def test_equal_suitors_go_by_number():
    lists, costs = [[0], [0]], {(0, 0): 1.0, (1, 0): 1.0}
    assert marry(lists, costs, 1)[0].tolist() == [0, -1]


def test_the_engine_refuses_what_would_corrupt_memory():
    good = (np.array([0, 1], np.int32), np.array([0, 1], np.int32), np.array([1.0, 1.0]))
    assert _engine.assign(2, 2, *good).tolist() == [0, 1]
    for rows, columns in (([0, 5], [0, 1]), ([0, 1], [0, -1]), ([1, 0], [0, 1])):
        with pytest.raises(ValueError, match=r"indices|ordered"):
            _engine.assign(2, 2, np.array(rows, np.int32), np.array(columns, np.int32), good[2])
    with pytest.raises(ValueError, match="receivers"):
        _engine.marry(np.array([0, 1]), np.array([3], np.int32), np.array([0.0]), 2)


@pytest.mark.parametrize("name", SOLVERS)
def test_random_sparse_problems_are_solved(name, tmp_path):
    problems = Problems(name, tmp_path, seed=7)
    for i in range(150):
        problems.feed(*problems.damaged(i))
