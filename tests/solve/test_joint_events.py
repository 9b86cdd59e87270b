"""Marginals of joint association events against enumeration, transfer matrices and themselves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism import _engine
from asterism.errors import ParameterError, SolverLimit
from asterism.solve import joint_marginals
from tests.references.joint_events import chain_events, enumerate_events
from tests.solve.groups import random_group


def weight_of(event, weights, miss):
    assert len(set(event[event >= 0])) == (event >= 0).sum()
    return math.fsum(miss[i] if j < 0 else weights[i, j] for i, j in enumerate(event))


def check_exact(weights, miss, *, tolerance=1e-12):
    found = joint_marginals(weights, miss)
    marginals, log_total, top = enumerate_events(weights, miss)
    assert found.method == "exact"
    assert found.bound == 0
    assert abs(found.marginals - marginals).max(initial=0) < tolerance
    assert found.log_total == pytest.approx(log_total, rel=1e-12, abs=1e-12)
    assert weight_of(found.best, weights, miss) == pytest.approx(top, rel=1e-12, abs=1e-12)
    assert abs(found.marginals.sum(axis=1) - 1).max(initial=0) < 1e-12
    assert found.marginals[:, :-1].sum(axis=0).max(initial=0) <= 1 + 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_equals_enumeration(seed):
    rng = np.random.default_rng(seed)
    for k in range(200):
        n, m = rng.integers(0, 5 if k % 10 else 6, 2)
        check_exact(*random_group(rng, n, m, ties=k % 4 == 0))


@pytest.mark.parametrize("seed", range(5))
def test_equals_enumeration_where_plain_weights_would_underflow(seed):
    rng = np.random.default_rng(100 + seed)
    for k in range(100):
        n, m = rng.integers(1, 5, 2)
        weights, miss = random_group(rng, n, m, spread=rng.choice([600, 700]), ties=k % 2 == 0)
        check_exact(weights, miss)


@pytest.mark.parametrize("scale", [1e3, 1e6])
def test_great_logs_cost_no_precision(scale):
    # Densities may carry any factor of a track's own; its log must not eat the digits.
    rng = np.random.default_rng(6)
    for _ in range(40):
        weights, miss = random_group(rng, 4, 4, spread=3)
        offset = rng.uniform(-scale, scale, 4)
        check_exact(weights + offset[:, None], miss + offset, tolerance=1e-13)


def test_two_rivals_that_hate_to_miss():
    # A forward pass in plain scaled doubles loses the state that wins in the end: it has e^-1200 of
    # the other's weight, and the weight comes back only with the second track.
    found = joint_marginals([[600.0], [600.0]], [-600.0, -600.0])
    assert found.marginals == pytest.approx(np.full((2, 2), 0.5), abs=1e-15)
    assert found.log_total == pytest.approx(math.log(2), abs=1e-12)


def test_without_tracks_or_detections():
    none = joint_marginals(np.zeros((0, 3)), [])
    assert none.marginals.shape == (0, 4)
    assert none.best.shape == (0,)
    assert (none.log_total, none.method, none.bound, none.n_states) == (0, "exact", 0, 1)
    alone = joint_marginals(np.zeros((2, 0)), [-1.0, -2.0])
    assert alone.marginals.tolist() == [[1], [1]]
    assert alone.best.tolist() == [-1, -1]
    assert alone.log_total == -3


def test_a_column_outside_every_gate_gets_nothing():
    weights = np.zeros((3, 3))
    weights[:, 1] = -np.inf
    assert (joint_marginals(weights, np.zeros(3)).marginals[:, 1] == 0).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_order_does_not_matter(seed, n, m):
    rng = np.random.default_rng(seed)
    weights, miss = random_group(rng, n, m)
    rows, columns = rng.permutation(n), rng.permutation(m)
    a, b = joint_marginals(weights, miss), joint_marginals(weights[rows][:, columns], miss[rows])
    assert abs(b.marginals[:, :-1] - a.marginals[rows][:, columns]).max() < 1e-13
    assert abs(b.marginals[:, -1] - a.marginals[rows, -1]).max() < 1e-13
    assert b.log_total == pytest.approx(a.log_total, abs=1e-11)
    assert weight_of(b.best, weights[rows][:, columns], miss[rows]) == pytest.approx(
        weight_of(a.best, weights, miss), abs=1e-11
    )


@pytest.mark.parametrize("max_states", [2, 2**20])
def test_independent_groups_multiply(max_states):
    rng = np.random.default_rng(3)
    groups = [random_group(rng, n, m, spread=3) for n, m in ((4, 5), (6, 3), (1, 1), (5, 5))]
    n, m = sum(len(miss) for _, miss in groups), sum(w.shape[1] for w, _ in groups)
    weights, miss = np.full((n, m), -np.inf), np.concatenate([miss for _, miss in groups])
    apart = [joint_marginals(*group, max_states=max_states) for group in groups]
    i = j = 0
    for w, _ in groups:
        weights[i : i + w.shape[0], j : j + w.shape[1]] = w
        i, j = i + w.shape[0], j + w.shape[1]
    both = joint_marginals(weights, miss, max_states=max_states)
    i = j = 0
    for one in apart:
        rows = both.marginals[i : i + len(one.best)]
        width = one.marginals.shape[1] - 1
        assert abs(rows[:, j : j + width] - one.marginals[:, :-1]).max() < 1e-14
        assert abs(rows[:, -1] - one.marginals[:, -1]).max() < 1e-14
        i, j = i + len(one.best), j + width
    assert both.log_total == pytest.approx(sum(one.log_total for one in apart), abs=1e-12)
    assert 1 - both.bound == pytest.approx(math.prod(1 - one.bound for one in apart), rel=1e-6)
    assert both.n_states == max(one.n_states for one in apart)


def chain(rng, n, spread):
    left, right, miss = rng.uniform(-spread, spread, (3, n))
    weights = np.full((n, n + 1), -np.inf)
    i = np.arange(n)
    weights[i, i], weights[i, i + 1] = left, right
    return weights, left, right, miss


@pytest.mark.parametrize("spread", [1, 20, 600])
def test_a_chain_of_a_hundred(spread):
    rng = np.random.default_rng(4)
    weights, left, right, miss = chain(rng, 100, spread)
    rows, columns = rng.permutation(100), rng.permutation(101)
    found = joint_marginals(weights[rows][:, columns], miss[rows])
    marginals, log_total = chain_events(left, right, miss)
    back = np.empty((100, 101))
    back[np.ix_(rows, columns)] = found.marginals[:, :-1]
    i = np.arange(100)
    assert found.method == "exact"
    assert found.n_states <= 4
    # The oracle's own logs of some ten thousand are good to a few 1e-12.
    assert abs(back[i, i] - marginals[:, 0]).max() < 2e-11
    assert abs(back[i, i + 1] - marginals[:, 1]).max() < 2e-11
    assert abs(found.marginals[:, -1] - marginals[rows, 2]).max() < 2e-11
    assert found.log_total == pytest.approx(log_total, rel=1e-12)


@pytest.mark.parametrize(("n", "m"), [(3, 40), (40, 3)])
def test_the_smaller_side_sets_the_price(n, m):
    found = joint_marginals(np.zeros((n, m)), np.zeros(n))
    assert found.n_states == 8
    # All events weigh 1: k of the tracks have detections, in C(n, k) · m! / (m - k)! ways.
    total = sum(math.comb(n, k) * math.perm(m, k) for k in range(min(n, m) + 1))
    assert found.log_total == pytest.approx(math.log(total), abs=1e-12)


@pytest.mark.parametrize("n", [12, 14, 20])
def test_a_full_group_counts_its_events(n):
    # Twelve bits are more than a tile of the engine; twenty keep only some layers.
    found = joint_marginals(np.zeros((n, n)), np.zeros(n))
    total = sum(math.comb(n, k) * math.perm(n, k) for k in range(n + 1))
    missed = sum(math.comb(n - 1, k) * math.perm(n, k) for k in range(n))
    assert found.n_states == 2**n
    assert found.log_total == pytest.approx(math.log(total), abs=1e-12)
    assert found.marginals[:, -1] == pytest.approx(np.full(n, missed / total), rel=1e-11)
    assert found.marginals[:, :-1] == pytest.approx(
        np.full((n, n), (1 - missed / total) / n), rel=1e-11
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_wide_group_is_a_derivative_of_its_total(seed):
    # β_ij = ∂ log Z / ∂ log w_ij, by central differences; and β_i0 alike.
    rng = np.random.default_rng(seed)
    weights, miss = rng.normal(0, 1, (13, 14)), rng.normal(0, 1, 13)
    weights[rng.random(weights.shape) < 0.2] = -np.inf
    found = joint_marginals(weights, miss)
    assert found.n_states > 2**11
    step = 1e-5
    for i, j in [*rng.integers(0, 13, (12, 2)).tolist(), (2, -1), (9, -1)]:
        totals = []
        for sign in (-1, 1):
            w, o = weights.copy(), miss.copy()
            if j < 0:
                o[i] += sign * step
            else:
                w[i, j] += sign * step
            totals.append(joint_marginals(w, o).log_total)
        slope = (totals[1] - totals[0]) / (2 * step)
        assert found.marginals[i, j] == pytest.approx(slope, abs=1e-8)


def distance_of_beam(found, exact, events):
    assert found.log_total <= exact.log_total + 1e-9
    share = -math.expm1(found.log_total - exact.log_total)  # of events left out
    assert share <= found.bound + 1e-12
    assert abs(found.marginals - exact.marginals).max() <= found.bound + 1e-12
    assert abs(found.marginals.sum(axis=1) - 1).max() < 1e-12
    assert weight_of(found.best, *events) == pytest.approx(
        weight_of(exact.best, *events), rel=1e-12
    )
    return share


@pytest.mark.parametrize("seed", range(8))
def test_the_beam_is_never_further_off_than_it_says(seed):
    rng = np.random.default_rng(seed)
    n_beams, tightness = 0, []
    for k in range(60):
        n, m = rng.integers(3, 10, 2)
        group = random_group(rng, n, m, spread=rng.choice([0.5, 3, 10, 600]), ties=k % 5 == 0)
        exact = joint_marginals(*group)
        for max_states in (1, 2, 5, 12, 30, 70, 200):
            found = joint_marginals(*group, max_states=max_states)
            if max_states >= exact.n_states:
                assert found.method == "exact"
            share = distance_of_beam(found, exact, group)
            assert (found.method == "beam") == (found.bound > 0)
            if found.method == "beam":
                n_beams += 1
                assert found.n_states <= max(max_states, n + m + 1)
                if 1e-9 < share < 0.1:
                    tightness.append(found.bound / share)
            else:
                assert abs(found.marginals - exact.marginals).max() < 1e-12
    assert n_beams > 100
    assert np.median(tightness) < 10  # a bound of 1 would be right too, and worth nothing


def test_the_bound_falls_to_nothing_as_states_are_added():
    rng = np.random.default_rng(11)
    group = rng.normal(0, 8, (12, 12)), np.zeros(12)
    bounds = [joint_marginals(*group, max_states=2**k).bound for k in range(13)]
    assert bounds[0] > 0.1
    assert bounds[9] < 0.1
    assert bounds[11] < 1e-3
    assert bounds[12] == 0
    assert all(b < 2 * a for a, b in itertools.pairwise(bounds))


def test_a_frontier_of_hundreds_in_a_beam():
    # Every track wants its own detection much more than a miss, and a miss more than any other.
    n = 150
    weights = np.full((n, n), -30.0)
    np.fill_diagonal(weights, 12.0)
    found = joint_marginals(weights, np.zeros(n), max_states=2000)
    assert found.method == "beam"
    assert 0 < found.bound < 1e-3
    assert found.best.tolist() == list(range(n))
    assert np.diagonal(found.marginals) == pytest.approx(
        np.full(n, 1 / (1 + math.exp(-12))), abs=found.bound
    )
    assert found.log_total == pytest.approx(n * math.log1p(math.exp(12)), abs=2 * found.bound)


def test_too_many_rivals_at_once():
    with pytest.raises(SolverLimit, match="at most 1024"):
        joint_marginals(np.zeros((1100, 1100)), np.zeros(1100), max_states=4)


def left_or_by_one_of_four(n_links, log_last):
    """Links with one way to go left and four to go right, and a last one with a dear right.

    A track t_i has d_i or one of a_i1..a_i4, and the track that has it then moves to d_(i + 1).
    No track may miss, so that all go left up to some link and right after it; at that link the t_i
    may still have d_i or have left it.
    """
    n, k = n_links, 4
    weights = np.full((n * (1 + k), n + 1 + n * k), -np.inf)
    for i in range(n):
        t, s, a = i * (1 + k), i * (1 + k) + 1 + np.arange(k), n + 1 + i * k + np.arange(k)
        weights[t, i] = 0
        weights[t, a] = 0
        weights[s, a] = 0
        weights[s, i + 1] = log_last if i == n - 1 else 0
    return weights, np.full(n * (1 + k), -5000.0)


def test_beyond_the_range_of_doubles_the_bound_says_so():
    # In the end 4^540 ways right outweigh the one way left by e^749, which loses it; but the
    # last link makes them all worth nothing. With 525 links a few digits are left.
    for n_links, log_last in ((540, -2000.0), (525, -2000.0), (20, -5.0)):
        found = joint_marginals(*left_or_by_one_of_four(n_links, log_last))
        assert found.n_states <= 8
        assert abs(found.marginals.sum(axis=1) - 1).max() < 1e-12
        if n_links > 500:
            assert found.method == "beam"
            assert found.bound == 1
        else:
            assert found.method == "exact"
            ways = 1 + 2 * sum(4.0**r for r in range(1, n_links + 1)) * math.exp(log_last)
            assert found.log_total == pytest.approx(math.log(ways), abs=1e-12)


def test_the_same_bytes_every_time():
    rng = np.random.default_rng(5)
    group = rng.normal(0, 2, (10, 10)), np.zeros(10)
    for max_states in (50, 2**20):
        a, b = (joint_marginals(*group, max_states=max_states) for _ in range(2))
        assert (a.marginals == b.marginals).all()
        assert (a.log_total, a.bound) == (b.log_total, b.bound)


@pytest.mark.parametrize(
    ("weights", "miss", "max_states", "name"),
    [
        ([[np.nan]], [0.0], 10, "log_weights"),
        ([[np.inf]], [0.0], 10, "log_weights"),
        ([[1e101]], [0.0], 10, "log_weights"),
        ([[-1e101]], [0.0], 10, "log_weights"),
        ([0.0], [0.0], 10, "log_weights"),
        ([[0.0]], [0.0, 0.0], 10, "log_weights"),
        ([["a"]], [0.0], 10, "log_weights"),
        ([[0.0]], [np.nan], 10, "log_miss"),
        ([[0.0]], [-np.inf], 10, "log_miss"),
        ([[0.0]], [1e101], 10, "log_miss"),
        ([[0.0]], [[0.0]], 10, "log_miss"),
        ([[0.0]], [0.0], 0, "max_states"),
        ([[0.0]], [0.0], 1.5, "max_states"),
        ([[0.0]], [0.0], 2**31, "max_states"),
        ([[0.0]], [0.0], True, "max_states"),
    ],
)
def test_bad_input_is_refused_by_name(weights, miss, max_states, name):
    with pytest.raises(ParameterError) as caught:
        joint_marginals(weights, miss, max_states=max_states)
    assert caught.value.name == name


def test_the_engine_refuses_what_would_corrupt_memory():
    with pytest.raises(ValueError, match="shape"):
        _engine.joint_marginals(np.zeros((2, 2)), np.zeros(3), 10)
    with pytest.raises(ValueError, match="max_states"):
        _engine.joint_marginals(np.zeros((2, 2)), np.zeros(2), 0)


@pytest.mark.parametrize(("n", "seed"), [(250, 2), (255, 1), (259, 2), (259, 3), (262, 0)])
def test_marginals_of_sparse_groups_whose_frontier_fills_the_bit_set(n, seed):
    # A beam that used a slot more than its frontier has vertices wrote past a set of 64 bits: rows
    # summed to 1.05 and columns to 1.008 in four of these, and nothing said so.
    rng = np.random.default_rng(seed)
    weights = np.full((n, n), -np.inf)
    for row in weights:
        row[rng.choice(n, 3, replace=False)] = rng.normal(0, 1, 3)
    found = joint_marginals(weights, np.zeros(n), max_states=200)
    assert found.method == "beam"
    assert abs(found.marginals.sum(axis=1) - 1).max() < 1e-12
    assert found.marginals[:, :-1].sum(axis=0).max() <= 1 + 1e-12
    assert ((found.marginals >= 0) & (found.marginals <= 1 + 1e-12)).all()
