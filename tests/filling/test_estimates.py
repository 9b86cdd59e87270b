"""Estimates of a gap and their weights: windows, rigid clusters, patterns, bridges, errors."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from asterism.simulate import Burst
from asterism.tracking.filling import estimates
from asterism.tracking.filling.ends import CAREFUL, NOISES, OFFSETS, SPANS, bridges
from asterism.tracking.filling.neighbours import fit_body
from asterism.tracking.filling.patterns import RIDGES, learn_pattern
from asterism.tracking.filling.scores import (
    disagreement_factor,
    error_profile,
    minimum_variance_weights,
)
from asterism.tracking.filling.spans import Span, find_gaps, held_out, n_apart, usable_ends
from asterism.tracking.rigidity.distances import distances_from
from tests.filling.fills import MODEL, occluded_at, rigid


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.booleans(), min_size=12, max_size=12), min_size=1, max_size=4))
def test_gaps_are_those_between_detections(rows):
    seen = np.array(rows).T
    expected = []
    for k in range(seen.shape[1]):
        t = np.flatnonzero(seen[:, k])
        expected += [
            Span(track=k, first=int(a) + 1, last=int(b) - 1)
            for a, b in itertools.pairwise(t)
            if b > a + 1
        ]
    assert find_gaps(seen) == expected


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_windows_have_all_that_they_need_and_no_other_has(seed):
    rng = np.random.default_rng(seed)
    own, smoothed, helped = rng.random((3, 60)) < 0.85
    smoothed |= own
    frames = np.array([16, 18, 20, 21, 23, 24, 25, 26, 28])
    near = np.array([18, 20, 21, 26, 28])
    span = Span(track=0, first=23, last=25)
    expected = [
        a
        for a in range(60 - 12)
        if (helped & smoothed)[a + frames - 16].all()
        and own[a + near - 16].all()
        and own[a + span.frames - 16].sum() >= 2
    ]
    found = held_out(own, smoothed, helped, frames, span, 1000)
    np.testing.assert_array_equal(found[:, 0], expected)
    shifts = np.broadcast_to(frames - 16, found.shape)
    np.testing.assert_array_equal(found - found[:, :1], shifts)
    assert len(held_out(own, smoothed, helped, frames, span, 5)) == min(5, len(expected))


def test_ends_are_the_nearest_frames_that_were_seen():
    seen = np.ones(60, dtype=bool)
    seen[[18, 19, 30, 31, 32, 33, 36]] = False
    ends = usable_ends(seen, Span(track=0, first=30, last=33))
    np.testing.assert_array_equal(ends, [*range(20, 30), 34, 35, *range(37, 45)])


def test_windows_apart_hide_nothing_twice():
    windows = np.arange(40)[:, None] + np.arange(12)
    assert n_apart(windows, 5) == 8
    assert n_apart(windows[:0], 5) == 0


@pytest.mark.parametrize("n_axes", [2, 3])
def test_bodies_are_rigid_fits_by_singular_values(n_axes):
    """Kabsch 1976, Acta Crystallographica A 32."""
    truth = rigid(5, 40, noise=2e-3, n_axes=n_axes)
    points, w = truth.positions(), np.array([1.0, 2, 3, 1, 2])
    body = fit_body(points, w)
    shape = body.to_body(points).mean(axis=0)
    for t in range(40):
        middle = w @ points[t] / w.sum()
        U, _, Vt = np.linalg.svd((points[t] - middle).T @ (w[:, None] * shape))
        U[:, -1] *= np.sign(np.linalg.det(U) * np.linalg.det(Vt))  # no reflection
        np.testing.assert_allclose(body.turns[t], U @ Vt, atol=1e-5)
        np.testing.assert_allclose(body.middles[t], middle, atol=1e-12)
    np.testing.assert_allclose(body.to_room(body.to_body(points)), points, atol=1e-12)
    assert (np.linalg.det(body.turns) > 0).all()


def test_the_spread_is_half_the_middle_of_the_distances():
    rng = np.random.default_rng(1)
    marker, others = rng.normal(size=(501, 3)), rng.normal(size=(501, 4, 3))
    others[:200, 1] = np.nan
    others[:, 3] = np.nan
    distance = np.linalg.norm(others - marker[:, None], axis=2)
    low, high = np.nanquantile(distance[:, :3], [0.16, 0.84], axis=0)
    found = distances_from(marker, others).spread
    np.testing.assert_allclose(found[:3], (high - low) / 2, rtol=0.05)
    assert np.isnan(found[3])


def test_patterns_are_ridge_regressions():
    rng = np.random.default_rng(2)
    Z = rng.normal(size=(90, 5)) + 3
    y = Z @ rng.normal(size=(5, 2)) + rng.normal(scale=0.3, size=(90, 2)) + 7
    is_known = np.arange(90) % 10 != 3
    found = learn_pattern(Z, y, is_known, 10)
    centred, target = Z[is_known], y[is_known]
    mean = centred.mean(axis=0)
    trace = ((centred - mean) ** 2).sum() / 5
    all_ridges = []
    for ridge in RIDGES:
        A, b = centred - mean, target - target.mean(axis=0)
        B = np.linalg.solve(A.T @ A + ridge * trace * np.eye(5), A.T @ b)
        all_ridges.append((Z - mean) @ B + target.mean(axis=0))
    off = [np.abs(found.by_all - one).max() for one in all_ridges]
    assert min(off) < 1e-9
    # What is foretold of a fold has not seen it: another place there changes nothing.
    changed = y.copy()
    changed[is_known & (found.fold == 3)] += 100
    again = learn_pattern(Z, changed, is_known, 10)
    assert not np.allclose(again.by_all, found.by_all, atol=1)
    np.testing.assert_allclose(again.by_fold[3], found.by_fold[3], atol=0.2)  # but for the ridge


def test_bridges_are_gaussian_processes():
    times = np.array([0, 1, 2, 3, 4, 5, 6, 7, 9.0]) / 100
    is_end = np.array([1, 1, 1, 0, 0, 0, 1, 1, 1], dtype=bool)
    found = bridges(times[None], is_end)
    length = (times[-1] - times[0]) / 3
    tau, noise, offset = SPANS[1] * length, NOISES[1], OFFSETS[0]

    def k(a, b):
        r = np.sqrt(5) * np.abs(a[:, None] - b) / tau
        return np.exp(-r) * (1 + r + r**2 / 3) + offset

    e, h = times[is_end], times[~is_end]
    K = k(e, e) + noise * np.eye(6)
    np.testing.assert_allclose(found.weights[CAREFUL, 0], k(h, e) @ np.linalg.inv(K), atol=1e-9)
    left = np.diag(k(h, h) - k(h, e) @ np.linalg.inv(K) @ k(e, h))
    np.testing.assert_allclose(found.left, left / left.max(), atol=1e-9)
    # Windows at other times have weights of their own, those at the same times share them.
    two = bridges(np.stack([times, times + 3]), is_end)
    assert two.weights.shape[1] == 1
    other = times.copy()
    other[4] += 0.003
    many = bridges(np.stack([times, other]), is_end)
    np.testing.assert_allclose(many.weights[:, 0], found.weights[:, 0], atol=1e-6)
    missed = np.random.default_rng(0).normal(size=(2, 6, 3))
    np.testing.assert_allclose(
        two.carry(missed), np.einsum("mln,bnd->mbld", two.weights[:, 0], missed), atol=1e-12
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 3))
def test_weights_are_the_best_of_a_fine_grid(seed, J):
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(J, J)) @ rng.normal(size=(J, 400)) + rng.normal(size=(J, 400))
    w = minimum_variance_weights(e.reshape(J, 20, 20, 1))
    assert (w >= 0).all()
    assert w.sum() == pytest.approx(1)
    grid = np.random.default_rng(1).dirichlet(np.ones(J), 3000)
    C = e @ e.T / 400
    C += 1e-3 * np.diag(np.diag(C))
    assert w @ C @ w <= np.einsum("ij,jk,ik->i", grid, C, grid).min() * (1 + 1e-9)


def test_fills_do_not_use_the_points_left_out(monkeypatch):
    """A hole beside the withheld frame is smoothed with its help: no window may begin there."""
    monkeypatch.setattr(estimates, "MAX_WINDOWS", 1000)
    truth = rigid(frames=120, noise=1e-4)
    take = estimates.DenseTracks(
        times=truth.detections.times,
        positions=occluded_at(truth, (0, 60, 60), (0, 40, 40), (3, 80, 84)).positions(),
        model=MODEL,
    )
    assert np.isfinite(take.smoothed[60, 0]).all()
    assert np.isnan(take.smoothed[80:85, 3]).all()  # too long
    found = estimates.estimate(take, Span(track=0, first=60, last=60))
    middle = found.windows[:, found.windows.shape[1] // 2]
    assert not set(middle) & {37, 38, 39, 40, 41, 42, 43}
    assert {36, 44} <= set(middle)
    assert np.isfinite(found.truth).all()


def test_smoothed_positions_are_no_truth(monkeypatch):
    """Neither an error nor the way through the gap is measured where a marker was smoothed."""
    truth = rigid(frames=90, noise=1e-4)
    holes = [(0, t, t) for t in (20, 40)]
    positions = occluded_at(truth, (0, 60, 66), *holes).positions()
    take = estimates.DenseTracks(times=truth.detections.times, positions=positions, model=MODEL)
    seen_by_carried = []
    carried = estimates.carried_estimate
    monkeypatch.setattr(
        estimates,
        "carried_estimate",
        lambda name, base, there, is_end, *rest: (
            seen_by_carried.append((there, is_end)) or carried(name, base, there, is_end, *rest)
        ),
    )
    found = estimates.estimate(take, Span(track=0, first=60, last=66))
    own = take.seen[found.windows, 0]
    assert not own.all()  # some windows have a hole
    for there, is_end in seen_by_carried:
        occluded = np.isfinite(there[:-1, ~is_end]).all(axis=2)
        np.testing.assert_array_equal(occluded, own[:, ~is_end])
        assert np.isfinite(there[:, is_end]).all()
    np.testing.assert_array_equal(np.isfinite(found.truth).all(axis=2), own[:, ~is_end])
    assert all(np.isfinite(one.values).all() for one in found.each)


def test_the_profile_is_the_mean_over_what_is_known():
    rng = np.random.default_rng(0)
    off = rng.normal(size=(6, 5, 3))
    off[:4, 1] = np.nan
    off[:, 3] = np.nan  # not known: by the frames around it
    expected = [np.mean([x @ x / 3 for x in off[:, t] if np.isfinite(x[0])]) for t in (0, 1, 2, 4)]
    between = (expected[2] + expected[3]) / 2
    np.testing.assert_allclose(error_profile(off), [*expected[:3], between, expected[3]])


def test_the_deviation_grows_as_estimators_disagree():
    rng = np.random.default_rng(0)
    z = rng.normal(size=(200, 5, 3))
    apart = rng.normal(size=(2, 201, 5, 3))
    alike = apart / np.sqrt((apart**2).mean(axis=(0, 2, 3)))[:, None, None]

    def growth(apart, z, factor):
        last = np.append(np.ones(200), factor)[:, None, None]
        return disagreement_factor(apart * last, z)

    # Equal disagreement in all windows determines nothing: errors are assumed to grow with it.
    assert growth(alike, z, 10) == pytest.approx(10)
    assert growth(alike, z, 0.1) == pytest.approx(0.1)
    # If the windows determine the relation, it is used: errors grow as the root of the
    # disagreement, or not at all.
    spread = np.exp(rng.normal(size=200))
    varied = alike * np.append(spread, 1.0)[:, None, None]
    even = z / np.sqrt((z**2).mean(axis=(1, 2)))[:, None, None]
    assert growth(varied, even * np.sqrt(spread)[:, None, None], 10) == pytest.approx(
        np.sqrt(10 / spread.mean()), rel=0.1
    )
    assert growth(varied, even, 10) == pytest.approx(1, rel=0.1)


def test_points_filled_before_are_no_measurements():
    truth = am.simulate.corrupt(am.simulate.person(seed=7), burst=Burst(), seed=7)
    once = am.fill_gaps(truth, model=MODEL)
    twice = am.fill_gaps(once.tracks, model=MODEL)
    np.testing.assert_array_equal(once.tracks.detections.points, twice.tracks.detections.points)
    d = once.tracks.detections
    for got in (
        am.track(d, model=MODEL),
        am.stitch(once.tracks, MODEL).tracks,
        am.simulate.corrupt(once.tracks),
    ):
        assert got.detections.n_points == truth.detections.n_points
        assert got.detections.filled is None
    starts = (
        am.track(d, am.MCMCDA(), model=MODEL, seed=1, start=once.tracks),
        am.track(truth.detections, am.MCMCDA(), model=MODEL, seed=1, start=truth),
    )
    np.testing.assert_array_equal(starts[0].labels, starts[1].labels)
    assert am.estimate_model(d).model == am.estimate_model(truth.detections).model


def test_the_ridge_is_the_one_with_the_smallest_error():
    rng = np.random.default_rng(3)
    Z = rng.normal(size=(90, 5))
    y = Z @ rng.normal(size=(5, 3))
    found = learn_pattern(Z, y, np.ones(90, dtype=bool), 10)
    np.testing.assert_allclose(found.by_all, y, atol=1e-4)  # the strongest one misses by 0.01
