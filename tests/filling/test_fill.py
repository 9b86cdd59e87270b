"""Gaps filled: oracles, exactness, ends that meet, calibration, and flags that survive files."""

from __future__ import annotations

import dataclasses
import itertools
import json

import ezc3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import asterism as am
from asterism import _engine
from asterism.cli import main
from asterism.io.captures.c3d_layout import read_c3d
from asterism.simulate import Burst
from asterism.tracking.filling import estimates
from asterism.tracking.filling.ends import CAREFUL, NOISES, OFFSETS, SPANS, bridges, is_steady
from asterism.tracking.filling.neighbours import fit_body
from asterism.tracking.filling.patterns import RIDGES, learn_pattern
from asterism.tracking.filling.scores import _doubt, _profile, _weights
from asterism.tracking.filling.spans import Span, find_gaps, held_out, n_apart, usable_ends
from asterism.tracking.rigidity.distances import distances_from
from tests.paths import DATA

MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=10, velocity_sigma=2),
    sensor=am.Sensor(noise_sigma=1e-4, p_detection=0.95, clutter_density=0.1),
    population=am.Population(birth_density=0.1, p_disappear=1e-3, max_speed=8, max_gap=10),
)


def hidden_at(truth, *spans):
    """Hide a marker in some frames; give the tracks that are left."""
    positions = truth.positions()
    for k, first, last in spans:
        positions[first : last + 1, k] = np.nan
    return am.Tracks.from_dense(truth.detections.times, positions, truth.names)


def rigid(n_markers=6, frames=300, seed=0, noise=0.0, n_axes=3, times=None):
    """Make a rigid body that tumbles through the room."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / 100 if times is None else times
    shape = rng.uniform(-0.3, 0.3, (n_markers, n_axes))
    middle = np.stack([np.sin(t + i) + 0.3 * np.sin(5 * t) for i in range(n_axes)], axis=1)
    if n_axes == 3:
        turn = Rotation.from_rotvec(np.stack([3 * t, np.sin(4 * t), t], axis=1)).as_matrix()
    else:
        c, s = np.cos(3 * t), np.sin(3 * t)
        turn = np.stack([c, -s, s, c], axis=1).reshape(-1, 2, 2)
    at = np.einsum("tij,kj->tki", turn, shape) + middle[:, None]
    return am.Tracks.from_dense(t, at + rng.normal(scale=noise or 1e-300, size=at.shape))


def errors(filling, truth):
    """Errors of the filled points, and their standard deviations."""
    d = filling.tracks.detections
    k = d.filled
    at = truth.positions()[d.frame_of[k], filling.tracks.labels[k]]
    return d.points[k] - at, d.stds[k]


# --- the parts, each against a slow obvious one


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
    own, bridged, helped = rng.random((3, 60)) < 0.85
    bridged |= own
    frames = np.array([16, 18, 20, 21, 23, 24, 25, 26, 28])
    near = np.array([18, 20, 21, 26, 28])
    span = Span(track=0, first=23, last=25)
    expected = [
        a
        for a in range(60 - 12)
        if (helped & bridged)[a + frames - 16].all()
        and own[a + near - 16].all()
        and own[a + span.hidden - 16].sum() >= 2
    ]
    found = held_out(own, bridged, helped, frames, span, 1000)
    np.testing.assert_array_equal(found[:, 0], expected)
    shifts = np.broadcast_to(frames - 16, found.shape)
    np.testing.assert_array_equal(found - found[:, :1], shifts)
    assert len(held_out(own, bridged, helped, frames, span, 5)) == min(5, len(expected))


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
def test_bodies_are_the_rigid_fits_of_the_engine(n_axes):
    truth = rigid(5, 40, noise=2e-3, n_axes=n_axes)
    points, w = truth.positions(), np.array([1.0, 2, 3, 1, 2])
    body = fit_body(points, w)
    shape = body.to_body(points).mean(axis=0)
    for t in range(40):
        R, from_, to, _ = _engine.fit_rigid(shape, np.ascontiguousarray(points[t]), w)
        got = body.to_body(points[t][None].repeat(40, axis=0))[t]
        expected = (points[t] - to[:n_axes]) @ R[:n_axes, :n_axes] + from_[:n_axes]
        np.testing.assert_allclose(got, expected, atol=1e-5)
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
    w = _weights(e.reshape(J, 20, 20, 1))
    assert (w >= 0).all()
    assert w.sum() == pytest.approx(1)
    grid = np.random.default_rng(1).dirichlet(np.ones(J), 3000)
    C = e @ e.T / 400
    C += 1e-3 * np.diag(np.diag(C))
    assert w @ C @ w <= np.einsum("ij,jk,ik->i", grid, C, grid).min() * (1 + 1e-9)


# --- the whole


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("length", [1, 10, 60])
@pytest.mark.parametrize("n_markers", [4, 6])  # three neighbours are flat, and easily mirrored
def test_a_rigid_body_carries_its_marker_exactly(n_axes, length, n_markers):
    truth = rigid(n_markers, n_axes=n_axes)
    filling = am.fill_gaps(hidden_at(truth, (2, 100, 99 + length)), model=MODEL)
    e, std = errors(filling, truth)
    assert len(e) == length
    assert np.abs(e).max() < 1e-9
    assert std.max() < 1e-6
    (gap,) = filling.gaps
    assert gap.estimator in ("body", "pattern")
    assert gap.rms["smoother"] > 100 * gap.rms[gap.estimator]


def test_irregular_times():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.006, 0.014, 300))
    truth = rigid(times=times, noise=1e-4)
    filling = am.fill_gaps(hidden_at(truth, (2, 100, 130)), model=MODEL)
    e, _ = errors(filling, truth)
    assert np.sqrt((e**2).sum(axis=1).mean()) < 1e-3


def test_a_take_too_short_to_try_says_so():
    truth = rigid(frames=60)
    filling = am.fill_gaps(hidden_at(truth, (2, 15, 44)), model=MODEL)
    (gap,) = filling.gaps
    assert gap.n_windows == 0
    assert gap.rms == {}
    assert gap.is_filled
    e, _ = errors(filling, truth)
    assert np.abs(e).max() < 1e-6


@pytest.mark.parametrize("n_markers", [1, 2, 3])
def test_few_neighbours_or_none(n_markers):
    truth = rigid(n_markers, noise=1e-4)
    filling = am.fill_gaps(hidden_at(truth, (0, 100, 109)), model=MODEL)
    (gap,) = filling.gaps
    assert gap.is_filled
    assert gap.n_neighbours == n_markers - 1
    e, std = errors(filling, truth)
    assert np.sqrt((e**2).mean()) < 0.01
    assert ((e / std[:, None]) ** 2).mean() < 9


def test_fills_meet_their_ends_without_a_kink():
    truth = am.simulate.person(seed=2)
    spans = [(k, 60 + 3 * k, 60 + 3 * k + 25) for k in range(0, 50, 7)]
    filled = am.fill_gaps(hidden_at(truth, *spans), model=MODEL).tracks.positions()
    whole = truth.positions()
    for k, first, last in spans:
        off = filled[first : last + 1, k] - whole[first : last + 1, k]
        for at in (
            off[0],
            off[-1],
        ):  # no jump: far less than is off in the middle, or next to nothing
            assert np.linalg.norm(at) < max(5e-4, 0.5 * np.linalg.norm(off, axis=1).max())
        usual = np.linalg.norm(np.diff(whole[:, k], 2, axis=0), axis=1).max()
        bends = np.linalg.norm(np.diff(filled[first - 2 : last + 3, k], 2, axis=0), axis=1)
        assert bends.max() < 1.5 * usual + 1e-3


def test_std_is_small_at_the_ends():
    truth = am.simulate.person(seed=3)
    d = am.fill_gaps(hidden_at(truth, (8, 120, 160)), model=MODEL).tracks.detections
    std = d.stds[d.filled]
    assert std[[0, -1]].max() < std[10:-10].min()


def test_nothing_measured_is_changed():
    truth = am.simulate.corrupt(am.simulate.person(seed=4), burst=Burst(), clutter=0.05, seed=4)
    filling = am.fill_gaps(truth, model=MODEL)
    again = filling.tracks.measured()
    np.testing.assert_array_equal(again.detections.points, truth.detections.points)
    np.testing.assert_array_equal(again.detections.offsets, truth.detections.offsets)
    np.testing.assert_array_equal(again.labels, truth.labels)
    assert again.names == truth.names
    n = sum(len(gap) for gap in filling.gaps if gap.is_filled)
    assert filling.tracks.detections.n_points == truth.detections.n_points + n
    assert repr(filling) == f"Filling({filling.n_filled} of {len(filling.gaps)} gaps, {n} points)"


def test_only_gaps_with_two_ends_that_are_not_too_long():
    truth = rigid(frames=400)
    tracks = hidden_at(truth, (0, 0, 20), (1, 380, 399), (2, 100, 148), (2, 200, 249), (3, 50, 350))
    filling = am.fill_gaps(tracks, model=MODEL, longest=0.5)
    assert [(g.track, g.first, g.last, g.is_filled) for g in filling.gaps] == [
        (2, 100, 148, True), (2, 200, 249, False), (3, 50, 350, False),
    ]  # fmt: skip
    assert "0.5 s" in filling.gaps[1].reason
    filled = np.isfinite(filling.tracks.positions()[..., 0])
    assert not filled[:21, 0].any()
    assert not filled[380:, 1].any()
    assert filled[100:149, 2].all()
    assert not filled[200:250, 2].any()


def test_a_marker_that_flickers_before_it_is_lost():
    truth = rigid(8, noise=1e-4)
    tracks = hidden_at(truth, (2, 100, 120))
    positions = tracks.positions()
    positions[97:100, 2] += [0.03, -0.02, 0.03]
    positions[121, 2] += [0.0, 0.04, 0.0]
    spoilt = am.Tracks.from_dense(truth.detections.times, positions)
    e, _ = errors(am.fill_gaps(spoilt, model=MODEL), truth)
    assert np.linalg.norm(e, axis=1).max() < 2e-3


def test_frames_after_a_jump_are_not_believed():
    frames = np.r_[90:100, 120:130]
    places = np.zeros((20, 3))
    places[8:10] = 0.03
    kept = is_steady(places, frames, Span(track=0, first=100, last=119), 1e-3)
    np.testing.assert_array_equal(np.flatnonzero(~kept), [8, 9])


def test_the_same_input_gives_the_same():
    truth = am.simulate.corrupt(am.simulate.person(seed=5), burst=Burst(), seed=5)
    one, two = (am.fill_gaps(truth, model=MODEL).tracks.detections for _ in range(2))
    np.testing.assert_array_equal(one.points, two.points)
    np.testing.assert_array_equal(one.stds, two.stds)


@pytest.mark.parametrize("turn", [0, 1])
def test_where_the_room_is_does_not_matter(turn):
    truth = am.simulate.corrupt(am.simulate.person(seed=6), noise=3e-4, seed=1)
    tracks = hidden_at(truth, (11, 100, 130))
    R = Rotation.from_euler("xyz", [0.3, 0.2, 1.0]).as_matrix() if turn else np.eye(3)
    moved = am.Tracks.from_dense(truth.detections.times, tracks.positions() @ R.T + [3, -2, 1.0])
    one, two = (am.fill_gaps(t, model=MODEL).tracks for t in (tracks, moved))
    np.testing.assert_allclose(
        one.positions()[100:131, 11] @ R.T + [3, -2, 1.0], two.positions()[100:131, 11], atol=1e-6
    )


def people_filled():
    e, std = [], []
    for seed in range(10):
        activity = ("walk", "run", "jump")[seed % 3]
        truth = am.simulate.person(activity=activity, seed=seed, frames=600)
        noisy = am.simulate.corrupt(truth, noise=3e-4, seed=seed)
        rng = np.random.default_rng(seed)
        spans = [
            (int(k), int(a), int(a + rng.integers(5, 60)))
            for k, a in zip(rng.permutation(53)[:8], rng.integers(30, 500, 8), strict=True)
        ]
        filling = am.fill_gaps(hidden_at(noisy, *spans), model=MODEL)
        assert all(gap.n_windows for gap in filling.gaps)
        one, its = errors(filling, noisy)
        e.append(one)
        std.append(its)
    return np.concatenate(e), np.concatenate(std)


def test_fills_are_as_sure_as_they_say():
    e, std = people_filled()
    z = np.abs(e / std[:, None])
    assert len(z) > 2000
    assert 0.6 < (z**2).mean() < 1.5
    assert 0.66 < (z < 1).mean() < 0.82
    assert (z < 1.96).mean() == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize(("missing", "tried"), [(0.1, 0.99), (0.2, 0.9)])
def test_points_missing_at_random_are_tried_too(missing, tried):
    person = am.simulate.person(activity="walk", seed=3, frames=200)
    some = am.Tracks.from_dense(person.detections.times, person.positions()[:, :8])
    noisy = am.simulate.corrupt(some, noise=3e-4, seed=3)
    filling = am.fill_gaps(am.simulate.corrupt(noisy, missing=missing, seed=4), model=MODEL)
    assert np.mean([gap.n_windows > 0 for gap in filling.gaps]) > tried
    e, std = errors(filling, noisy)
    assert np.median(np.linalg.norm(e, axis=1)) < 1e-3  # of noise alone 0.46 mm
    z = np.abs(e / std[:, None])
    assert std.max() < 5e-3
    assert (z < 1.96).mean() == pytest.approx(0.95, abs=0.03)


def test_what_is_bridged_knows_nothing_of_what_is_hidden(monkeypatch):
    """A hole beside the hidden frame is bridged with its help: no window may begin there."""
    monkeypatch.setattr(estimates, "MOST_WINDOWS", 1000)
    truth = rigid(frames=120, noise=1e-4)
    take = estimates.Take(
        times=truth.detections.times,
        positions=hidden_at(truth, (0, 60, 60), (0, 40, 40), (3, 80, 84)).positions(),
        model=MODEL,
    )
    assert np.isfinite(take.bridged[60, 0]).all()
    assert np.isnan(take.bridged[80:85, 3]).all()  # too long
    found = estimates.estimate(take, Span(track=0, first=60, last=60))
    middle = found.windows[:, found.windows.shape[1] // 2]
    assert not set(middle) & {37, 38, 39, 40, 41, 42, 43}
    assert {36, 44} <= set(middle)
    assert np.isfinite(found.truth).all()


def test_what_is_bridged_is_no_truth(monkeypatch):
    """Neither an error nor the way through the gap is measured where a marker was bridged."""
    truth = rigid(frames=90, noise=1e-4)
    holes = [(0, t, t) for t in (20, 40)]
    positions = hidden_at(truth, (0, 60, 66), *holes).positions()
    take = estimates.Take(times=truth.detections.times, positions=positions, model=MODEL)
    seen_by_carried = []
    carried = estimates._carried
    monkeypatch.setattr(
        estimates,
        "_carried",
        lambda name, base, there, is_end, *rest: (
            seen_by_carried.append((there, is_end)) or carried(name, base, there, is_end, *rest)
        ),
    )
    found = estimates.estimate(take, Span(track=0, first=60, last=66))
    own = take.seen[found.windows, 0]
    assert not own.all()  # some windows have a hole
    for there, is_end in seen_by_carried:
        hidden = np.isfinite(there[:-1, ~is_end]).all(axis=2)
        np.testing.assert_array_equal(hidden, own[:, ~is_end])
        assert np.isfinite(there[:, is_end]).all()
    np.testing.assert_array_equal(np.isfinite(found.truth).all(axis=2), own[:, ~is_end])
    assert all(np.isfinite(one.values).all() for one in found.each)


def test_the_profile_is_the_mean_over_what_is_known():
    rng = np.random.default_rng(0)
    off = rng.normal(size=(6, 5, 3))
    off[:4, 1] = np.nan
    off[:, 3] = np.nan  # nobody knows: by the frames around it
    expected = [np.mean([x @ x / 3 for x in off[:, t] if np.isfinite(x[0])]) for t in (0, 1, 2, 4)]
    between = (expected[2] + expected[3]) / 2
    np.testing.assert_allclose(_profile(off), [*expected[:3], between, expected[3]])


def test_doubt_grows_as_estimators_disagree():
    rng = np.random.default_rng(0)
    z = rng.normal(size=(200, 5, 3))
    apart = rng.normal(size=(2, 201, 5, 3))
    alike = apart / np.sqrt((apart**2).mean(axis=(0, 2, 3)))[:, None, None]

    def doubt(apart, z, factor):
        last = np.append(np.ones(200), factor)[:, None, None]
        return _doubt(apart * last, z)

    # Windows that disagree alike tell nothing: errors are taken to grow with disagreement.
    assert doubt(alike, z, 10) == pytest.approx(10)
    assert doubt(alike, z, 0.1) == pytest.approx(0.1)
    # Windows that tell of it are believed: errors as the root of it, or none the larger.
    spread = np.exp(rng.normal(size=200))
    varied = alike * np.append(spread, 1.0)[:, None, None]
    even = z / np.sqrt((z**2).mean(axis=(1, 2)))[:, None, None]
    assert doubt(varied, even * np.sqrt(spread)[:, None, None], 10) == pytest.approx(
        np.sqrt(10 / spread.mean()), rel=0.1
    )
    assert doubt(varied, even, 10) == pytest.approx(1, rel=0.1)


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


def test_confidence_of_a_fill_is_that_of_its_ends():
    truth = hidden_at(rigid(), (2, 100, 110))
    d = truth.detections
    confidence = np.full(d.n_points, 0.9)
    confidence[(d.frame_of == 111) & (truth.labels == 2)] = 0.4
    tracks = am.fill_gaps(dataclasses.replace(truth, confidence=confidence), model=MODEL).tracks
    assert set(tracks.confidence[tracks.detections.filled]) == {0.4}
    assert (np.sort(tracks.confidence[~tracks.detections.filled]) == np.sort(confidence)).all()


@pytest.mark.parametrize("frames", [0, 1, 2, 3])
def test_little_or_nothing(frames):
    at = np.zeros((frames, 2, 3)) + np.arange(2)[:, None] + np.arange(frames)[:, None, None]
    at[1:2, 1] = np.nan
    tracks = am.Tracks.from_dense(np.arange(frames) / 100, at)
    filling = am.fill_gaps(tracks, model=MODEL)
    assert len(filling.gaps) == (frames == 3)
    if frames == 3:
        np.testing.assert_allclose(filling.tracks.positions()[1, 1], [2, 2, 2], atol=0.01)
    else:
        assert filling.tracks is tracks


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"longest": 0}, "longest"),
        ({"longest": np.nan}, "longest"),
        ({"model": 3}, "estimate_model"),
    ],
)
def test_options_are_checked(wrong, text):
    with pytest.raises(am.ParameterError, match=text):
        am.fill_gaps(rigid(frames=10), **wrong)
    with pytest.raises(am.ParameterError, match=r"am\.track"):
        am.fill_gaps(rigid(frames=10).detections)


# --- flags in Detections and in files


def test_flags_are_checked():
    d = rigid(2, 3).detections
    n = d.n_points
    for wrong in ({"filled": [True]}, {"stds": np.full(n, -1.0)}, {"stds": np.full(n, np.nan)}):
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            dataclasses.replace(d, **wrong)
    assert d.measured() is d


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a file that has gaps, and what filling it gives."""
    folder = tmp_path_factory.mktemp("made")
    truth = am.simulate.corrupt(am.simulate.person(seed=8), burst=Burst(), noise=3e-4, seed=8)
    am.write(truth, folder / "in.c3d")
    MODEL.to_toml(folder / "model.toml")
    return folder, am.fill_gaps(am.io.read_tracks(folder / "in.c3d"), model=MODEL)


@pytest.mark.parametrize("form", ["c3d", "csv"])
def test_files_give_back_the_flags(made, form, tmp_path):
    tracks = made[1].tracks
    am.write(tracks, tmp_path / f"a.{form}")
    again = am.io.read_tracks(tmp_path / f"a.{form}")
    before, after = (
        set(zip(d.frame_of[d.filled], one.labels[d.filled], strict=True))
        for one, d in ((tracks, tracks.detections), (again, again.detections))
    )
    assert before == after
    assert again.detections.filled.sum() == tracks.detections.filled.sum() > 0
    np.testing.assert_allclose(again.positions(), tracks.positions(), rtol=1e-6)
    am.write(again, tmp_path / f"b.{form}")
    assert (tmp_path / f"a.{form}").read_bytes() == (tmp_path / f"b.{form}").read_bytes()
    if form == "csv":
        np.testing.assert_array_equal(again.detections.stds, tracks.detections.stds)
    # What is not filled any more is not said to be.
    am.write(again.measured(), tmp_path / f"c.{form}")
    assert am.read(tmp_path / f"c.{form}").filled is None


@pytest.mark.parametrize("known", [False, True])
def test_c3d_has_residual_0_for_filled_points_alone(tmp_path, known):
    tracks = hidden_at(rigid(), (2, 100, 110))
    if known:
        residuals = np.linspace(0, 2e-3, tracks.detections.n_points)
        cameras = np.full(tracks.detections.n_points, 5)
        tracks = dataclasses.replace(
            tracks,
            detections=dataclasses.replace(tracks.detections, residuals=residuals, cameras=cameras),
        )
    filled = am.fill_gaps(tracks, model=MODEL).tracks
    am.write(filled, tmp_path / "a.c3d")
    words = read_c3d(tmp_path / "a.c3d").points[..., 3]
    assert (words[100:111, 2] == 0).all()
    words = np.delete(words, np.s_[100:111], axis=0)
    assert (words % 256 > 0).all()
    if known:  # without cameras ezc3d gives no residual but 0
        theirs = ezc3d.c3d(str(tmp_path / "a.c3d"))["data"]["meta_points"]["residuals"][0].T
        assert (theirs[100:111, 2] == 0).all()
        assert (np.delete(theirs, np.s_[100:111], axis=0) > 0).all()
    again = am.read(tmp_path / "a.c3d")
    assert (again.residuals is not None) == known
    if known:
        np.testing.assert_allclose(
            again.residuals[~again.filled], np.maximum(residuals, 1e-5), atol=6e-6
        )


def test_c3d_of_others_is_read_as_ever(tmp_path):
    """Residuals of 0 beside others tell nothing where the file does not say that they do."""
    tracks = rigid()
    residuals = np.where(np.arange(tracks.detections.n_points) % 3, 1e-3, 0.0)
    d = dataclasses.replace(tracks.detections, residuals=residuals)
    am.write(dataclasses.replace(tracks, detections=d), tmp_path / "a.c3d")
    assert am.read(tmp_path / "a.c3d").filled is None


@pytest.mark.parametrize("form", ["trc", "csv-wide", "qtm", "pointcloud"])
def test_formats_without_room_refuse(made, form, tmp_path):
    tracks = made[1].tracks
    with pytest.raises(am.ParameterError, match="c3d, csv"):
        am.write(tracks, tmp_path / "a", format=form)
    assert not (tmp_path / "a").exists()
    am.write(tracks, tmp_path / "a", format=form, unflagged=True)
    again = am.read(tmp_path / "a", format=form)
    assert again.n_points == tracks.detections.n_points
    am.write(tracks.measured(), tmp_path / "b", format=form)


@pytest.mark.parametrize("cell", ["2", "x", "", "0.5"])
def test_a_flag_is_0_or_1(tmp_path, cell):
    path = tmp_path / "a.csv"
    path.write_text(f"frame,time_s,x_m,y_m,track,filled,std\n1,0,1,1,0,{cell},0\n")
    with pytest.raises(am.FormatError, match="filled"):
        am.read(path)


# --- the command


def run(line, capsys, code=0):
    capsys.readouterr()
    assert main(line.split()) == code, capsys.readouterr().err
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return err if code else out


def test_the_command_fills_and_says_what(made, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(made[0])
    out = tmp_path / "out.csv"
    text = run(f"fill in.c3d -o {out} --model model.toml", capsys)
    for word in ("gaps", "filled", "mostly by", "least sure", "mm", "written"):
        assert word in text
    d, expected = am.read(out), made[1]
    assert d.filled.sum() == expected.tracks.detections.filled.sum()
    given = json.loads(run(f"fill in.c3d -o {out} --model model.toml --json --overwrite", capsys))
    assert given["n_gaps"] == len(expected.gaps) == len(given["gaps"])
    assert given["largest_std"] == pytest.approx(max(gap.std for gap in expected.gaps))
    assert sum(given["estimators"].values()) == given["n_filled"]
    assert given["gaps"][0]["first"] == expected.gaps[0].first + 1
    assert (
        run(f"fill in.c3d -o {out} --model model.toml -q --longest 0.1 --overwrite", capsys) == ""
    )
    assert am.read(out).filled.sum() < d.filled.sum()


def test_the_command_refuses_in_one_line(made, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(made[0])
    before = sorted(path.name for path in made[0].iterdir())
    for line, says in (
        ("fill nowhere.c3d -o a.c3d", "nowhere.c3d: no such file"),
        ("fill in.c3d -o in.c3d", "a place of its own"),
        ("fill in.c3d -o a.trc", "--unflagged"),
        ("fill in.c3d -o a.xyz", "a name ending in"),
        ("fill in.c3d -o a.c3d --longest 0", "--longest"),
        ("fill in.c3d -o a.c3d --model in.c3d", "in.c3d"),
        ("fill in.c3d -o nowhere/a.c3d", "a folder that exists"),
    ):
        error = run(line, capsys, code=2)
        assert says in error, line
        assert error.count("\n") == 1
    assert sorted(path.name for path in made[0].iterdir()) == before


def test_the_command_on_points_without_tracks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    d = rigid().detections
    am.write(am.Tracks(detections=d, labels=np.full(d.n_points, -1)), "a.csv")
    assert "asterism track" in run("fill a.csv -o b.csv", capsys, code=2)


@pytest.mark.data
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}")
@pytest.mark.parametrize("name", ["walking_1.c3d", "HC030A22.c3d"])
def test_real_captures(name):
    (path,) = DATA.rglob(name)
    truth = am.simulate.corrupt(am.read(path).tracks)
    spans = [(k, 60 + 8 * k, 60 + 8 * k + 39) for k in range(1, 31, 3)]
    filling = am.fill_gaps(hidden_at(truth, *spans), model=MODEL)
    e, std = errors(filling, truth)
    # Splines through the same ends are off by 5 to 50 mm.
    assert np.median(np.linalg.norm(e, axis=1)) < 1.5e-3
    assert (np.abs(e) < 1.96 * std[:, None]).mean() > 0.85
