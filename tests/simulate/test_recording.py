"""What a recording system adds: lost frames, false and merged points, visitors, cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asterism.camera import Capsule, Polygon, Rig
from asterism.errors import ParameterError
from asterism.model import Capture, Detections, Tracks
from asterism.simulate import Burst, Ghosts, Truth, Visits, corrupt, cube, smooth
from tests.simulate.visible import detected, rows


def _half_named():
    # Track 1 has no name and the last point is clutter: neither is truth beside a named track.
    d = Detections.from_frames(
        [0.0, 0.1], [[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 1], [2, 0, 1], [3, 0, 0]]]
    )
    return Tracks(detections=d, labels=[0, 1, 2, 0, 2, -1], names=("A", None, "C"))


def test_points_without_a_name_are_left_out():
    result = corrupt(_half_named())
    assert result.names == ("A", "C")
    assert rows(result) == {(0, 0, 0, 0, 0), (0, 1, 2, 0, 0), (1, 0, 0, 0, 1), (1, 1, 2, 0, 1)}
    assert rows(result, is_true=False) == set()


def test_points_without_a_name_stay_as_clutter_on_request():
    result = corrupt(_half_named(), keep_unnamed=True, missing=1.0)
    assert rows(result, is_true=False) == {(0, -1, 1, 0, 0), (1, -1, 3, 0, 0)}


def test_tracks_are_all_truth_where_none_has_a_name():
    d = Detections.from_frames([0.0], [[[0, 0, 0], [1, 0, 0]]])
    result = corrupt(Tracks(detections=d, labels=[1, 0]))
    assert result.names == (None, None)
    assert rows(result) == {(0, 1, 0, 0, 0), (0, 0, 1, 0, 0)}


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
    assert result.names == ("A", "C")
    assert (got.labels == -1).all()  # the truth is in the result, not in the detections
    assert got.names == ()


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
    seen = detected(sensed)
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
        np.testing.assert_array_equal(detected(sensed), counts >= views)
    assert detected(corrupt(truth, rig=rig)).all()
    assert not detected(corrupt(truth, rig=rig, views=4)).all()
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
