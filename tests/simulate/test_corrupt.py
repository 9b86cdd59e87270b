"""Sensing: each switch does what it says, alone, and the truth stays true."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism.camera import Rig
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.simulate import Burst, Ghosts, Truth, Visits, corrupt, cube, smooth
from tests.simulate.visible import detected, rows


def _runs(is_on):
    """Give the lengths of the runs of True that end before the last frame and start after 0."""
    edges = np.diff(np.concatenate([[0], is_on.astype(int), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    inside = (starts > 0) & (stops < len(is_on))
    return (stops - starts)[inside]


def test_no_switch_only_shuffles():
    truth = smooth(n_markers=20, frames=50)
    result = corrupt(truth, seed=3)
    assert rows(result) == rows(truth)
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
    is_seen = detected(corrupt(smooth(n_markers=40, frames=2000), missing=0.1, seed=5))
    n = is_seen.size
    assert abs(is_seen.mean() - 0.9) < 4 * np.sqrt(0.09 / n)
    both = (~is_seen[1:] & ~is_seen[:-1]).mean()  # two misses in a row are no rarer, no likelier
    assert abs(both - 0.01) < 4 * np.sqrt(0.01 / n)


def test_missing_in_runs_keeps_the_share_and_has_the_stated_length():
    truth = smooth(n_markers=40, frames=5000)
    is_missed = ~detected(corrupt(truth, missing=0.2, missing_run=5.0, seed=5))
    starts = (is_missed[1:] & ~is_missed[:-1]).sum()
    assert is_missed.mean() == pytest.approx(0.2, abs=0.006)
    assert is_missed[1:].sum() / starts == pytest.approx(5.0, rel=0.04)
    # Whether a run goes on does not depend on how long it is.
    on = [is_missed[2:][is_missed[1:-1] & (is_missed[:-2] == old)].mean() for old in (False, True)]
    assert on == pytest.approx([0.8, 0.8], abs=0.02)
    # As short as chance alone makes them, they are chance alone.
    least = ~detected(corrupt(truth, missing=0.2, missing_run=1.25, seed=6))
    assert (least[1:] & least[:-1]).mean() == pytest.approx(0.04, abs=0.002)


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
    is_occluded = ~detected(corrupt(truth, burst=Burst(n=5, shortest=5, longest=60), seed=2))
    at_once = is_occluded.sum(axis=1)
    assert at_once.max() == 5
    assert abs(at_once.mean() - 2.5) < 0.3
    lengths = np.concatenate([_runs(is_occluded[:, k]) for k in range(200)])
    assert lengths.min() >= 5
    # Two shadows may meet on a marker, so a few runs are longer; most are drawn evenly.
    assert np.quantile(lengths, 0.97) <= 60
    assert abs(np.median(lengths) - 32.5) < 4
    assert (is_occluded.any(axis=0)).mean() > 0.9  # any marker may be the one


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
    assert rows(result, is_true=False) == rows(alone, is_true=False)


def test_each_switch_leaves_the_others_choices_alone():
    truth = smooth(n_markers=12, frames=200)
    switches = {"missing": 0.2, "clutter": 0.3, "burst": Burst(n=2), "ghosts": Ghosts()}
    for more in ({"nearby": 0.1}, {"doubled": 0.1}):
        # What is beside a marker goes when the marker goes; nothing else changes.
        alone, with_missing = (corrupt(truth, **more, **m, seed=9) for m in ({}, {"missing": 0.2}))
        assert rows(with_missing, is_true=False) < rows(alone, is_true=False)
    everything = corrupt(truth, **switches, seed=9)
    false = set()
    seen = np.ones((200, 12), dtype=bool)
    for name, value in switches.items():
        alone = corrupt(truth, **{name: value}, seed=9)
        false |= rows(alone, is_true=False)
        seen &= detected(alone)
    assert rows(everything, is_true=False) == false
    assert np.array_equal(detected(everything), seen)
    noisy = corrupt(truth, noise=0.01, seed=9).positions()
    noisy_too = corrupt(truth, noise=0.01, **switches, seed=9).positions()
    assert np.array_equal(noisy_too[seen], noisy[seen])


def test_markers_differ_in_their_noise():
    truth = smooth(n_markers=200, frames=400)
    error = corrupt(truth, noise=0.002, noise_spread=0.5, seed=1).positions() - truth.positions()
    sigma = error.std(axis=(0, 2))
    assert np.log(sigma / 0.002).std() == pytest.approx(0.5, abs=3 * 0.5 / np.sqrt(2 * 200))
    plain = corrupt(truth, noise=0.002, seed=1).positions() - truth.positions()
    assert np.log(plain.std(axis=(0, 2)) / 0.002).std() < 0.05
    np.testing.assert_allclose(error[:, 3] / plain[:, 3], (error / plain)[0, 3, 0])


def test_no_frame_left_is_an_empty_recording():
    from asterism.simulate import person

    for truth in (cube(frames=10), person(frames=10)):
        assert corrupt(truth, dropped=1.0).detections.n_frames == 0


@pytest.mark.parametrize(
    "wrong",
    [{"views": 3}, {"rig": "ring8"}, {"burst": 5}, {"clutter": 1e19},
     {"views": 9, "rig": Rig.ring(8, radius=3, height=1)}],
)  # fmt: skip
def test_switches_that_would_do_nothing_or_are_of_another_kind(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        corrupt(cube(frames=3), **wrong)
    with pytest.raises(ParameterError, match="truth"):
        corrupt(cube(frames=3).positions())


def test_visits_of_the_named_among_others():
    scene = smooth(n_markers=4, frames=60)
    names = ("A", None, "C", "D")
    truth = Truth(
        detections=scene.detections, labels=scene.labels, names=names, colours=[1, 2, 3, 4]
    )
    sensed = corrupt(truth, visits=Visits(shortest=5, longest=9), seed=1)
    of = {"A": (0, 1), "C": (2, 3), "D": (3, 4)}
    for k, name in enumerate(sensed.names):
        original, colour = of[name.split("/")[0]]
        assert sensed.colours[k] == colour
        there = np.isfinite(sensed.positions()[:, k, 0])
        np.testing.assert_array_equal(
            sensed.positions()[there, k], scene.positions()[there, original]
        )


def test_false_points_nearby_fill_their_ball_evenly():
    truth = Tracks.from_dense(np.arange(4000) / 100, np.zeros((4000, 1, 3)), ["a"])
    sensed = corrupt(truth, nearby=1.0, nearby_within=0.05, seed=3)
    far = np.linalg.norm(sensed.detections.points[sensed.labels < 0], axis=1)
    assert len(far) == 4000
    for share in (0.5, 0.8):
        expected = share**3
        inside = (far < share * 0.05).mean()
        assert inside == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 4000))
