"""Corruption: each switch does what it says, alone, and the truth stays true."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism.errors import ParameterError
from asterism.model import Capture, Detections, Tracks
from asterism.simulate import Burst, Ghosts, corrupt, cube, smooth


def _rows(tracks, is_true=True):
    """Give the set of (frame, marker, position) of the true or the false points."""
    chosen = (tracks.labels >= 0) == is_true
    d = tracks.detections
    return {
        (int(f), int(k), *p)
        for f, k, p in zip(
            d.frame_of[chosen], tracks.labels[chosen], d.points[chosen].tolist(), strict=True
        )
    }


def _seen(tracks):
    return np.isfinite(tracks.positions()).all(axis=2)


def _runs(is_on):
    """Give the lengths of the runs of True that end before the last frame and start after 0."""
    edges = np.diff(np.concatenate([[0], is_on.astype(int), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    inside = (starts > 0) & (stops < len(is_on))
    return (stops - starts)[inside]


def test_no_switch_only_shuffles():
    truth = smooth(n_markers=20, frames=50)
    result = corrupt(truth, seed=3)
    assert _rows(result) == _rows(truth)
    assert result.names == truth.names
    assert np.array_equal(result.detections.times, truth.detections.times)
    orders = {tuple(result.labels[20 * t : 20 * t + 20]) for t in range(50)}
    assert len(orders) == 50  # no two frames in the same order


def test_shuffling_is_fair():
    truth = smooth(n_markers=4, frames=20_000)
    place = corrupt(truth, seed=0).labels.reshape(-1, 4)
    share = np.array([[(place[:, i] == k).mean() for k in range(4)] for i in range(4)])
    assert np.abs(share - 0.25).max() < 4 * np.sqrt(0.25 * 0.75 / 20_000)


@settings(max_examples=60, deadline=None)
@given(
    missing=st.sampled_from([0.0, 0.3, 1.0]),
    clutter=st.sampled_from([0.0, 0.5]),
    burst=st.sampled_from([None, Burst(n=2, shortest=1, longest=4), Burst(n=0)]),
    ghosts=st.sampled_from([None, Ghosts(n=2, within=0.02)]),
    stride=st.integers(1, 4),
    frames=st.integers(1, 25),
    n_axes=st.sampled_from([2, 3]),
    seed=st.integers(0, 2**40),
)
def test_labels_are_true_whatever_the_switches(
    missing, clutter, burst, ghosts, stride, frames, n_axes, seed
):
    dense = smooth(n_markers=5, frames=frames).positions()[..., :n_axes].copy()
    dense[::3, 2] = np.nan
    truth = Tracks.from_dense(np.arange(frames) * 0.01, dense, list("abcde"))
    switches = {
        "missing": missing, "clutter": clutter, "burst": burst, "ghosts": ghosts,
        "stride": stride, "seed": seed,
    }  # fmt: skip
    result = corrupt(truth, **switches)
    assert result.names == tuple("abcde")
    assert np.array_equal(result.detections.times, truth.detections.times[::stride])
    positions = result.positions()
    is_seen = np.isfinite(positions).all(axis=2)
    assert np.array_equal(positions[is_seen], dense[::stride][is_seen])
    again = corrupt(truth, **switches)
    assert again.detections.points.tobytes() == result.detections.points.tobytes()
    assert again.labels.tobytes() == result.labels.tobytes()
    other = corrupt(truth, **{**switches, "seed": seed + 1})
    same = other.detections.points.tobytes() == result.detections.points.tobytes()
    assert result.detections.n_points < 30 or not same


def test_missing_drops_the_stated_share_independently():
    is_seen = _seen(corrupt(smooth(n_markers=40, frames=2000), missing=0.1, seed=5))
    n = is_seen.size
    assert abs(is_seen.mean() - 0.9) < 4 * np.sqrt(0.09 / n)
    both = (~is_seen[1:] & ~is_seen[:-1]).mean()  # two misses in a row are no rarer, no likelier
    assert abs(both - 0.01) < 4 * np.sqrt(0.01 / n)


def test_clutter_is_poisson_and_uniform_in_the_box():
    truth = cube(frames=5000)
    result = corrupt(truth, clutter=0.1, seed=6)
    d, is_false = result.detections, result.labels < 0
    counts = np.bincount(d.frame_of[is_false], minlength=5000)
    assert abs(counts.mean() - 0.8) < 4 * np.sqrt(0.8 / 5000)
    assert abs(counts.var() - 0.8) < 0.1  # as for a Poisson number, variance = mean
    low, high = truth.detections.points.min(axis=0) - 0.3, truth.detections.points.max(axis=0) + 0.3
    share = (d.points[is_false] - low) / (high - low)
    assert share.min() >= 0
    assert share.max() <= 1
    n = len(share)
    assert np.abs(share.mean(axis=0) - 0.5).max() < 4 / np.sqrt(12 * n)
    assert np.abs(share.var(axis=0) - 1 / 12).max() < 0.01


def test_margin_is_the_room_around_the_box():
    truth = cube()
    near, far = (corrupt(truth, clutter=5.0, margin=m).detections.points for m in (0.0, 2.0))
    low, high = truth.detections.points.min(axis=0), truth.detections.points.max(axis=0)
    assert (near >= low).all()
    assert (near <= high).all()
    assert far.max() > high.max() + 1.5


def test_noise_has_the_stated_size_on_each_axis():
    truth = smooth(n_markers=30, frames=1000)
    error = corrupt(truth, noise=0.003, seed=1).positions() - truth.positions()
    n = error.shape[0] * error.shape[1]
    spread = error.std(axis=(0, 1))
    assert np.abs(spread - 0.003).max() < 4 * 0.003 / np.sqrt(2 * n)
    assert np.abs(error.mean(axis=(0, 1))).max() < 4 * 0.003 / np.sqrt(n)
    between = np.corrcoef(error.reshape(-1, 3).T) - np.eye(3)
    assert np.abs(between).max() < 4 / np.sqrt(n)


def test_bursts_hide_at_most_n_for_the_stated_time():
    truth = smooth(n_markers=200, frames=6000)
    is_hidden = ~_seen(corrupt(truth, burst=Burst(n=5, shortest=5, longest=60), seed=2))
    at_once = is_hidden.sum(axis=1)
    assert at_once.max() == 5
    assert abs(at_once.mean() - 2.5) < 0.3
    lengths = np.concatenate([_runs(is_hidden[:, k]) for k in range(200)])
    assert lengths.min() >= 5
    # Two shadows may meet on a marker, so a few runs are longer; most are drawn evenly.
    assert np.quantile(lengths, 0.97) <= 60
    assert abs(np.median(lengths) - 32.5) < 4
    assert (is_hidden.any(axis=0)).mean() > 0.9  # any marker may be the one


def test_ghosts_are_few_short_and_near():
    truth = smooth(n_markers=30, frames=3000, seed=3)
    result = corrupt(truth, ghosts=Ghosts(n=3, shortest=1, longest=10, within=0.05), seed=4)
    d, is_ghost = result.detections, result.labels < 0
    counts = np.bincount(d.frame_of[is_ghost], minlength=3000)
    assert counts.max() == 3
    assert abs(counts.mean() - 1.5) < 0.15
    positions = truth.positions()
    gaps = d.points[is_ghost][:, None] - positions[d.frame_of[is_ghost]]
    distances = np.linalg.norm(gaps, axis=2)
    nearest = distances.argmin(axis=1)
    assert distances.min(axis=1).max() <= 0.05
    # A ghost keeps its place beside its marker; that tells one from the next.
    offsets = np.round(gaps[np.arange(len(gaps)), nearest], 9)
    _, lifetimes = np.unique(offsets, axis=0, return_counts=True)
    assert lifetimes.max() <= 10
    assert np.median(lifetimes) in (5, 6)
    # Evenly in a ball: half of the volume lies within 0.7937 of the radius.
    radii = np.linalg.norm(np.unique(offsets, axis=0), axis=1) / 0.05
    assert abs((radii < 0.5 ** (1 / 3)).mean() - 0.5) < 4 * 0.5 / np.sqrt(len(radii))


def test_ghosts_outlast_a_miss_of_their_marker():
    truth = cube(frames=300)
    result = corrupt(truth, missing=1.0, ghosts=Ghosts(), seed=1)
    assert (result.labels == -1).all()
    alone = corrupt(truth, ghosts=Ghosts(), seed=1)
    assert _rows(result, is_true=False) == _rows(alone, is_true=False)


def test_each_switch_leaves_the_others_choices_alone():
    truth = smooth(n_markers=12, frames=200)
    switches = {"missing": 0.2, "clutter": 0.3, "burst": Burst(n=2), "ghosts": Ghosts()}
    everything = corrupt(truth, **switches, seed=9)
    false = set()
    seen = np.ones((200, 12), dtype=bool)
    for name, value in switches.items():
        alone = corrupt(truth, **{name: value}, seed=9)
        false |= _rows(alone, is_true=False)
        seen &= _seen(alone)
    assert _rows(everything, is_true=False) == false
    assert np.array_equal(_seen(everything), seen)
    noisy = corrupt(truth, noise=0.01, seed=9).positions()
    noisy_too = corrupt(truth, noise=0.01, **switches, seed=9).positions()
    assert np.array_equal(noisy_too[seen], noisy[seen])


def _half_named():
    # Track 1 has no name and the last point is clutter: neither is truth beside a named track.
    d = Detections.from_frames(
        [0.0, 0.1], [[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 1], [2, 0, 1], [3, 0, 0]]]
    )
    return Tracks(detections=d, labels=[0, 1, 2, 0, 2, -1], names=("A", None, "C"))


def test_points_without_a_name_are_left_out():
    result = corrupt(_half_named())
    assert result.names == ("A", "C")
    assert _rows(result) == {(0, 0, 0, 0, 0), (0, 1, 2, 0, 0), (1, 0, 0, 0, 1), (1, 1, 2, 0, 1)}
    assert _rows(result, is_true=False) == set()


def test_points_without_a_name_stay_as_clutter_on_request():
    result = corrupt(_half_named(), keep_unnamed=True, missing=1.0)
    assert _rows(result, is_true=False) == {(0, -1, 1, 0, 0), (1, -1, 3, 0, 0)}


def test_tracks_are_all_truth_where_none_has_a_name():
    d = Detections.from_frames([0.0], [[[0, 0, 0], [1, 0, 0]]])
    result = corrupt(Tracks(detections=d, labels=[1, 0]))
    assert result.names == (None, None)
    assert _rows(result) == {(0, 1, 0, 0, 0), (0, 0, 1, 0, 0)}


def test_a_capture_stays_a_capture():
    d = smooth(n_markers=3, frames=10, rate=100).detections
    capture = Capture(
        times=d.times + 1.01, offsets=d.offsets, points=d.points, path=Path("trial.c3d"),
        format="c3d", rate=100.0, first_frame=102, units="mm", channels=np.tile([4, 5, 6], 10),
        labels=np.tile([0, 1, 2], 10), names=("A", None, "C"),
    )  # fmt: skip
    result = corrupt(capture.tracks, stride=3, clutter=1.0)
    got = result.detections
    assert isinstance(got, Capture)
    # At another rate, analog data and events of the file do not go with the points.
    assert (got.path, got.format, got.units) == (capture.path, "", "mm")
    whole = corrupt(capture.tracks).detections
    assert isinstance(whole, Capture)
    assert (whole.format, whole.first_frame, whole.rate) == ("c3d", 102, 100.0)
    assert np.isclose(got.rate, 100 / 3)
    assert got.first_frame == 34
    assert np.isclose((got.first_frame - 1) / got.rate, 0.99)  # less than a frame before 1.01 s
    assert (got.channels == -1).all()
    assert len(got.channels) == got.n_points
    assert np.array_equal(got.tracks.labels, result.labels)
    assert got.tracks.names == result.names == ("A", "C")


def test_nothing_to_corrupt():
    nothing = Tracks(detections=Detections.from_frames([0, 1], [[], []]), labels=[])
    result = corrupt(nothing, missing=0.5, clutter=1, noise=1, burst=Burst(), ghosts=Ghosts())
    assert result.detections.n_points == 0
    assert result.detections.n_frames == 2
    no_frames = Tracks(detections=Detections.from_frames([], []), labels=[])
    assert corrupt(no_frames, stride=2, clutter=1).detections.n_frames == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"missing": 1.1}, {"missing": float("nan")}, {"clutter": -1}, {"noise": -0.1},
        {"stride": 0}, {"margin": -1}, {"seed": -1},
    ],
)  # fmt: skip
def test_wrong_switches_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        corrupt(cube(frames=3), **wrong)


@pytest.mark.parametrize("kind", [Burst, Ghosts])
@pytest.mark.parametrize("wrong", [{"n": -1}, {"shortest": 0}, {"longest": 0}])
def test_wrong_episodes_are_refused(kind, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        kind(**wrong)
    with pytest.raises(ParameterError, match="within"):
        Ghosts(within=0)
