"""Sensing: each switch does what it says, alone, and the truth stays true."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism.camera import Capsule, Polygon, Rig
from asterism.errors import ParameterError
from asterism.model import Capture, Detections, Tracks
from asterism.simulate import Burst, Ghosts, Truth, Visits, corrupt, cube, smooth


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


def test_missing_in_runs_keeps_the_share_and_has_the_stated_length():
    truth = smooth(n_markers=40, frames=5000)
    is_missed = ~_seen(corrupt(truth, missing=0.2, missing_run=5.0, seed=5))
    starts = (is_missed[1:] & ~is_missed[:-1]).sum()
    assert is_missed.mean() == pytest.approx(0.2, abs=0.006)
    assert is_missed[1:].sum() / starts == pytest.approx(5.0, rel=0.04)
    # Whether a run goes on does not depend on how long it is.
    on = [is_missed[2:][is_missed[1:-1] & (is_missed[:-2] == old)].mean() for old in (False, True)]
    assert on == pytest.approx([0.8, 0.8], abs=0.02)
    # As short as chance alone makes them, they are chance alone.
    least = ~_seen(corrupt(truth, missing=0.2, missing_run=1.25, seed=6))
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
    for more in ({"nearby": 0.1}, {"doubled": 0.1}):
        # What is beside a marker goes when the marker goes; nothing else changes.
        alone, with_missing = (corrupt(truth, **more, **m, seed=9) for m in ({}, {"missing": 0.2}))
        assert _rows(with_missing, is_true=False) < _rows(alone, is_true=False)
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
        {"missing_run": 3.0}, {"missing": 0.5, "missing_run": 1.9},
        {"missing": 1.1}, {"missing": float("nan")}, {"clutter": -1}, {"noise": -0.1},
        {"stride": 0}, {"margin": -1}, {"seed": -1}, {"nearby": 2}, {"doubled": -0.1},
        {"merged": -1}, {"dropped": 1.5}, {"jitter": 1.0}, {"jitter": -0.1}, {"noise_spread": -1},
        {"nearby_within": 0}, {"doubled_apart": 0}, {"views": 0},
    ],
)  # fmt: skip
def test_wrong_switches_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        corrupt(cube(frames=3), **wrong)


@pytest.mark.parametrize("wrong", [{"shortest": 0}, {"longest": 0}])
def test_wrong_visits_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        Visits(**wrong)


@pytest.mark.parametrize("kind", [Burst, Ghosts])
@pytest.mark.parametrize("wrong", [{"n": -1}, {"shortest": 0}, {"longest": 0}])
def test_wrong_episodes_are_refused(kind, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        kind(**wrong)
    with pytest.raises(ParameterError, match="within"):
        Ghosts(within=0)


def test_markers_differ_in_their_noise():
    truth = smooth(n_markers=200, frames=400)
    error = corrupt(truth, noise=0.002, noise_spread=0.5, seed=1).positions() - truth.positions()
    sigma = error.std(axis=(0, 2))
    assert np.log(sigma / 0.002).std() == pytest.approx(0.5, abs=3 * 0.5 / np.sqrt(2 * 200))
    plain = corrupt(truth, noise=0.002, seed=1).positions() - truth.positions()
    assert np.log(plain.std(axis=(0, 2)) / 0.002).std() < 0.05
    np.testing.assert_allclose(error[:, 3] / plain[:, 3], (error / plain)[0, 3, 0])


def test_frames_are_lost_as_if_they_had_never_been():
    truth = smooth(n_markers=3, frames=5000, rate=100)
    sensed = corrupt(truth, dropped=0.2, seed=3)
    share = 1 - sensed.detections.n_frames / 5000
    assert share == pytest.approx(0.2, abs=4 * np.sqrt(0.2 * 0.8 / 5000))
    assert np.isin(sensed.detections.times, truth.detections.times).all()
    at = np.searchsorted(truth.detections.times, sensed.detections.times)
    np.testing.assert_array_equal(sensed.positions(), truth.positions()[at])


def test_shaken_frames_hold_the_places_of_their_own_times():
    # On a parabola the parabola through three frames is exact; at the ends the line is not.
    t = np.arange(200) / 50.0
    places = np.stack([t, 3 - 2 * t, 0.5 * t**2], axis=1)[:, None]
    truth = Tracks.from_dense(t, places, ["a"])
    sensed = corrupt(truth, jitter=0.8, seed=2)
    s = sensed.detections.times
    expected = np.stack([s, 3 - 2 * s, 0.5 * s**2], axis=1)[:, None]
    np.testing.assert_allclose(sensed.positions()[1:-1], expected[1:-1], atol=1e-12)
    np.testing.assert_allclose(sensed.positions(), expected, atol=1e-3)
    late = (s - t) * 50
    assert 0.35 < np.abs(late).max() <= 0.4
    assert np.abs(late.mean()) < 0.06
    assert (np.diff(s) > 0).all()


def test_false_points_beside_markers():
    truth = smooth(n_markers=30, frames=400)
    sensed = corrupt(truth, nearby=0.05, nearby_within=0.02, seed=4)
    n = (sensed.labels < 0).sum()
    assert n == pytest.approx(600, abs=4 * np.sqrt(600))
    d = sensed.detections
    for i in np.flatnonzero(sensed.labels < 0)[:200]:
        gap = np.linalg.norm(truth.positions()[d.frame_of[i]] - d.points[i], axis=1).min()
        assert gap <= 0.02


def test_doubled_points_lie_as_far_apart_as_asked():
    truth = smooth(n_markers=30, frames=400)
    sensed = corrupt(truth, doubled=0.03, doubled_apart=0.004, seed=5)
    d = sensed.detections
    false = np.flatnonzero(sensed.labels < 0)
    assert len(false) == pytest.approx(360, abs=4 * np.sqrt(360))
    for i in false[:200]:
        gap = np.linalg.norm(truth.positions()[d.frame_of[i]] - d.points[i], axis=1)
        assert np.isclose(gap, 0.004, rtol=1e-9).any()


def test_merged_points_are_one_in_the_middle():
    t = np.arange(3) / 10
    x = np.array([[0.0, 0.1, 0.5], [0.0, 0.01, 0.5], [0.2, 0.21, 0.22]])
    truth = Tracks.from_dense(t, np.stack([x, 0 * x, 0 * x], axis=2), ["a", "b", "c"])
    sensed = corrupt(truth, merged=0.015)
    expected = [[0.0, 0.1, 0.5], [0.005, np.nan, 0.5], [0.21, np.nan, np.nan]]
    np.testing.assert_allclose(sensed.positions()[..., 0], expected)
    crowd = smooth(n_markers=60, frames=100, spacing=0.08)
    d = corrupt(crowd, merged=0.02, seed=1).detections
    before = corrupt(crowd, seed=1).detections
    assert 0 < d.n_points < before.n_points


def test_visitors_come_and_go():
    truth = smooth(n_markers=20, frames=2000)
    sensed = corrupt(truth, visits=Visits(shortest=40, longest=120), seed=6)
    seen = _seen(sensed)
    assert seen.shape[1] == sensed.n_tracks > 20
    begins = seen.argmax(axis=0)
    lengths = seen.sum(axis=0)
    for k in range(seen.shape[1]):  # each is one unbroken visit
        assert seen[begins[k] : begins[k] + lengths[k], k].all()
    inner = (begins > 0) & (begins + lengths < 2000)
    assert lengths.max() <= 120
    assert lengths[inner].min() >= 40
    assert lengths[inner].mean() == pytest.approx(80, abs=5)
    at_once = seen.sum(axis=1)
    assert 20 * 0.5 < at_once.mean() < 20 * 0.85
    assert at_once.max() <= 20
    assert {name.split("/")[0] for name in sensed.names} == set(truth.names)


def test_what_the_cameras_do_not_see_is_missing():
    scene = cube(frames=40, seed=1)
    wall = Polygon(corners=[[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]])
    truth = Truth(
        detections=scene.detections, labels=scene.labels, names=scene.names, surfaces=(wall,)
    )
    rig = Rig.ring(6, radius=3, height=1, target=(0, 0, 0))
    for views in (2, 4):
        sensed = corrupt(truth, rig=rig, views=views)
        counts = rig.project(truth.positions(), truth.surfaces).visible.sum(axis=0)
        np.testing.assert_array_equal(_seen(sensed), counts >= views)
    assert _seen(corrupt(truth, rig=rig)).all()
    assert not _seen(corrupt(truth, rig=rig, views=4)).all()
    assert corrupt(truth, rig=rig).record == {"rig": list(rig.names), "views": 2, "seed": 0}


def test_lines_colours_and_surfaces_go_along():
    scene = cube(frames=30)
    ends = np.linspace(0, 1, 30)[:, None, None] + [[0, 0, 0], [0, 0, 1.0]]
    lines = np.zeros((8, 8), int)
    lines[0, 1] = lines[1, 0] = 3
    truth = Truth(
        detections=scene.detections, labels=scene.labels, names=scene.names,
        surfaces=(Capsule(ends=ends, radius=0.1),), connections=lines, colours=np.arange(1, 9),
    )  # fmt: skip
    sensed = corrupt(truth, stride=3)
    np.testing.assert_array_equal(sensed.surfaces[0].ends, ends[::3])
    np.testing.assert_array_equal(sensed.connections, lines)
    visited = corrupt(truth, visits=Visits(shortest=5, longest=9))
    first = [name.split("/")[0] for name in visited.names]
    expected = [1 + truth.names.index(name) for name in first]
    np.testing.assert_array_equal(visited.colours, expected)
    assert visited.connections.max() == 3


def test_the_record_says_what_was_on():
    sensed = corrupt(cube(), missing=0.1, ghosts=Ghosts(n=2), doubled=0.1, seed=7)
    assert sensed.record == {
        "missing": 0.1,
        "ghosts": {"n": 2, "shortest": 1, "longest": 10, "within": 0.05},
        "doubled": 0.1,
        "doubled_apart": 0.01,
        "seed": 7,
    }
    assert corrupt(cube()).record == {"seed": 0}


def test_points_know_their_cameras_and_false_ones_pretend():
    truth = cube(frames=60, seed=1)
    rig = Rig.ring(6, radius=3, height=1, target=(0, 0, 0), focal_px=2000)
    sensed = corrupt(truth, rig=rig, noise=0.002, clutter=0.5, seed=4)
    d = sensed.detections
    seen = rig.project(truth.positions()).visible
    expected = (seen * (1 << np.arange(6))[:, None, None]).sum(axis=0)
    true = sensed.labels >= 0
    np.testing.assert_array_equal(d.cameras[true], expected[d.frame_of[true], sensed.labels[true]])
    assert len(np.unique(d.cameras)) > 5
    assert np.isin(d.cameras[~true], d.cameras[true]).all()
    # The misfit of n rays: 2 n - 3 degrees of freedom, and nothing of the point's own error.
    n = np.array([int(c).bit_count() for c in d.cameras])
    expected = 0.002 * np.sqrt((2 * n - 3) / n)
    assert np.sqrt(np.mean((d.residuals / expected) ** 2)) == pytest.approx(1, abs=0.1)
    off = d.points[true] - truth.positions()[d.frame_of[true], sensed.labels[true]]
    assert abs(np.corrcoef(np.linalg.norm(off, axis=1), d.residuals[true])[0, 1]) < 0.15
    assert 0.8 < d.residuals[~true].mean() / d.residuals[true].mean() < 1.25
    assert corrupt(truth).detections.cameras is None


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
