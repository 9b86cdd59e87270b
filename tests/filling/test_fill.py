"""Gaps filled: oracles, exactness, ends that meet, calibration, and flags that survive files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import asterism as am
from asterism.simulate import Burst
from asterism.tracking.filling.ends import is_steady
from asterism.tracking.filling.spans import Span
from tests.filling.fills import MODEL, occluded_at, rigid
from tests.paths import DATA


def errors(filling, truth):
    """Errors of the filled points, and their standard deviations."""
    d = filling.tracks.detections
    k = d.filled
    at = truth.positions()[d.frame_of[k], filling.tracks.labels[k]]
    return d.points[k] - at, d.stds[k]


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("length", [1, 10, 60])
@pytest.mark.parametrize("n_markers", [4, 6])  # three neighbours are flat, and easily mirrored
def test_a_rigid_body_carries_its_marker_exactly(n_axes, length, n_markers):
    truth = rigid(n_markers, n_axes=n_axes)
    filling = am.fill_gaps(occluded_at(truth, (2, 100, 99 + length)), model=MODEL)
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
    filling = am.fill_gaps(occluded_at(truth, (2, 100, 130)), model=MODEL)
    e, _ = errors(filling, truth)
    assert np.sqrt((e**2).sum(axis=1).mean()) < 1e-3


def test_a_capture_too_short_to_try_says_so():
    truth = rigid(frames=60)
    filling = am.fill_gaps(occluded_at(truth, (2, 15, 44)), model=MODEL)
    (gap,) = filling.gaps
    assert gap.n_windows == 0
    assert gap.rms == {}
    assert gap.is_filled
    e, _ = errors(filling, truth)
    assert np.abs(e).max() < 1e-6


@pytest.mark.parametrize("n_markers", [1, 2, 3])
def test_few_neighbours_or_none(n_markers):
    truth = rigid(n_markers, noise=1e-4)
    filling = am.fill_gaps(occluded_at(truth, (0, 100, 109)), model=MODEL)
    (gap,) = filling.gaps
    assert gap.is_filled
    assert gap.n_neighbours == n_markers - 1
    e, std = errors(filling, truth)
    assert np.sqrt((e**2).mean()) < 0.01
    assert ((e / std[:, None]) ** 2).mean() < 9


def test_fills_meet_their_ends_without_a_kink():
    truth = am.simulate.person(seed=2)
    spans = [(k, 60 + 3 * k, 60 + 3 * k + 25) for k in range(0, 50, 7)]
    filled = am.fill_gaps(occluded_at(truth, *spans), model=MODEL).tracks.positions()
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
    d = am.fill_gaps(occluded_at(truth, (8, 120, 160)), model=MODEL).tracks.detections
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
    tracks = occluded_at(
        truth, (0, 0, 20), (1, 380, 399), (2, 100, 148), (2, 200, 249), (3, 50, 350)
    )
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
    tracks = occluded_at(truth, (2, 100, 120))
    positions = tracks.positions()
    positions[97:100, 2] += [0.03, -0.02, 0.03]
    positions[121, 2] += [0.0, 0.04, 0.0]
    damaged = am.Tracks.from_dense(truth.detections.times, positions)
    e, _ = errors(am.fill_gaps(damaged, model=MODEL), truth)
    assert np.linalg.norm(e, axis=1).max() < 2e-3


def test_frames_after_a_jump_are_not_used():
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
    tracks = occluded_at(truth, (11, 100, 130))
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
        filling = am.fill_gaps(occluded_at(noisy, *spans), model=MODEL)
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


def test_confidence_of_a_fill_is_that_of_its_ends():
    truth = occluded_at(rigid(), (2, 100, 110))
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
        ({"longest": -1}, "longest"),
        ({"longest": np.nan}, "longest"),
        ({"model": 3}, "estimate_model"),
    ],
)
def test_options_are_checked(wrong, text):
    with pytest.raises(am.ParameterError, match=text):
        am.fill_gaps(rigid(frames=10), **wrong)
    with pytest.raises(am.ParameterError, match=r"am\.track"):
        am.fill_gaps(rigid(frames=10).detections)


@pytest.mark.data
@pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}")
@pytest.mark.parametrize("name", ["walking_1.c3d", "HC030A22.c3d"])
def test_real_captures(name):
    (path,) = DATA.rglob(name)
    truth = am.simulate.corrupt(am.read(path).tracks)
    spans = [(k, 60 + 8 * k, 60 + 8 * k + 39) for k in range(1, 31, 3)]
    filling = am.fill_gaps(occluded_at(truth, *spans), model=MODEL)
    e, std = errors(filling, truth)
    # Splines through the same ends are off by 5 to 50 mm.
    assert np.median(np.linalg.norm(e, axis=1)) < 1.5e-3
    assert (np.abs(e) < 1.96 * std[:, None]).mean() > 0.85
