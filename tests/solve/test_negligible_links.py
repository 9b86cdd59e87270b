"""Links that are cut from groups too large for the exact sum, and the bound of what they carry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asterism import _engine
from tests.references.joint_events import enumerate_events
from tests.solve.groups import random_group


@pytest.mark.parametrize("seed", range(10))
def test_no_marginal_exceeds_its_bound(seed):
    rng = np.random.default_rng(300 + seed)
    for k in range(100):
        n, m = rng.integers(1, 6, 2)
        spread = float(rng.choice([1, 3, 10]))
        weights, miss = random_group(rng, n, m, spread=spread, ties=k % 4 == 0)
        exact = enumerate_events(weights, miss)[0][:, :-1]
        assert (exact - _engine.marginal_bounds(weights, miss)).max(initial=0) < 1e-12


def test_the_bounds_are_tight_where_each_track_has_a_detection_of_its_own():
    n = 5
    weights = np.full((n, n), -4.0) + 14 * np.eye(n)
    exact = enumerate_events(weights, np.zeros(n))[0][:, :-1]
    off = ~np.eye(n, dtype=bool)
    assert (_engine.marginal_bounds(weights, np.zeros(n))[off] < 3 * exact[off]).all()


def rows_of_crowds(rng, n_crowds, size):
    """Crowds in a row, each with weak links to the next, as one group of a wide frontier."""
    n = n_crowds * size
    weights, crowd = rng.normal(-12, 2, (n, n)), np.arange(n) // size
    weights[crowd[:, None] == crowd] = rng.normal(4, 3, (crowd[:, None] == crowd).sum())
    weights[abs(crowd[:, None] - crowd) > 1] = -np.inf
    return weights, rng.normal(0, 1, n)


@pytest.mark.parametrize("seed", range(5))
def test_cut_links_count_in_the_bound(seed):
    weights, miss = rows_of_crowds(np.random.default_rng(seed), 3, 5)
    exact, log_total, _, none, _ = _engine.joint_marginals(weights, miss, 2**22)
    assert none == 0
    cut, kept, _, bound, n_states = _engine.joint_marginals(weights, miss, 2**6, 1e-2)
    assert n_states <= 2**6
    assert 0 < bound < 0.1
    assert abs(cut - exact).max() <= bound + 1e-12
    # The events with a cut link are those that the total lacks.
    assert 0 < 1 - math.exp(kept - log_total) <= bound + 1e-12
    is_cut = (cut[:, :-1] == 0) & (exact[:, :-1] > 0)
    assert is_cut.sum() > 20
    assert exact[:, :-1][is_cut].max() <= 1e-2


def test_where_the_states_suffice_nothing_is_cut():
    weights, miss = rows_of_crowds(np.random.default_rng(7), 2, 3)
    plain = _engine.joint_marginals(weights, miss, 2**14)
    same = _engine.joint_marginals(weights, miss, 2**14, 0.5)
    assert same[3] == 0
    assert (same[0] == plain[0]).all()
