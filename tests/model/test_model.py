from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import asterism as am
from tests.scenes import interacting, small_model

ONE = [[0.0, 0.0, 0.0]]


@given(
    hnp.arrays(
        np.float64,
        st.tuples(st.integers(0, 6), st.integers(0, 4), st.sampled_from([2, 3])),
        elements=st.one_of(st.floats(-10, 10), st.just(np.nan)),
    )
)
def test_dense_positions_come_back(positions):
    times = np.arange(len(positions)) * 0.1
    tracks = am.Tracks.from_dense(times, positions)
    occluded = np.isnan(positions).any(axis=2)
    expected = np.where(occluded[..., None], np.nan, positions)
    assert np.array_equal(tracks.positions(), expected, equal_nan=True)
    assert tracks.detections.n_points == (~occluded).sum()
    assert [len(points) for _, points in tracks.detections] == (~occluded).sum(axis=1).tolist()


def test_frames_come_back():
    frames = [[[1, 2, 3]], [], [[4, 5, 6], [7, 8, 9]]]
    d = am.Detections.from_frames([0, 1, 3], frames)
    assert [points.tolist() for _, points in d] == frames
    assert d.frame_of.tolist() == [0, 2, 2]
    assert (d.n_frames, d.n_points, d.n_axes, len(d)) == (3, 3, 3, 3)
    assert d.step == 1.5


@pytest.mark.parametrize(
    ("times", "frames", "message"),
    [
        ([0, 0], [ONE, ONE], "times: expected strictly increasing .* at frames 0 and 1"),
        ([0, 2, 1], [ONE] * 3, "2 then 1 at frames 1 and 2"),
        ([0, np.nan], [ONE, ONE], r"times: expected finite numbers, found nan at index \(1,\)"),
        ([0], [ONE, ONE], "frames: expected 1 arrays"),
        ([0, 1], [ONE, [[0.0, 0]]], r"frames\[1\]: expected an array of shape \(n, 3\)"),
        ([0, 1], [ONE, [[0.0, 0, np.inf]]], r"frames\[1\]: expected finite numbers, found inf"),
        ([0], [[[1.0]]], "points: expected 2 or 3 coordinates"),
        ([0], [[["x", "y", "z"]]], "of numbers"),
        ([0], [[[1e200, 0, 0]]], "points: expected metres, within"),
    ],
)
def test_bad_detections_say_what_and_where(times, frames, message):
    with pytest.raises(am.ParameterError, match=message):
        am.Detections.from_frames(times, frames)


def test_a_capture_is_made_as_detections_are():
    frames = [[[0.0, 0, 0], [1, 0, 0]], [], [[1, 0, 0]]]
    dense = np.zeros((2, 2, 3))
    for d in (am.Capture.from_frames([0, 1, 3], frames), am.Capture.from_dense([0, 1], dense)):
        assert isinstance(d, am.Capture)
        assert d.channels.tolist() == d.labels.tolist() == [-1] * d.n_points
        assert d.tracks.n_tracks == 0
    # Without labels all detections are clutter, but labels of another length are an error.
    with pytest.raises(am.ParameterError, match="labels"):
        am.Capture(times=d.times, offsets=d.offsets, points=d.points, labels=[])


def test_detections_cannot_be_changed_from_outside():
    points, labels = np.zeros((2, 3)), np.array([0, 1])
    d = am.Detections(times=[0], offsets=[0, 2], points=points)
    tracks = am.Tracks(detections=d, labels=labels)
    points[0], labels[:] = np.nan, 0
    assert (d.points == 0).all()
    assert tracks.labels.tolist() == [0, 1]
    with pytest.raises(ValueError, match="read-only"):
        d.points[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        d.points = np.zeros((1, 3))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"labels": [0]}, r"labels: expected an array of shape \(2,\)"),
        ({"labels": [0, -2]}, "labels: expected track numbers from 0 to"),
        ({"labels": [0, 0]}, "at most one detection of a track in a frame, found two of track 0"),
        ({"labels": [0, 2**40]}, "labels: expected track numbers from 0 to"),
        ({"labels": [0.5, 1.0]}, "labels"),
        ({"names": ("a",)}, "names: expected a name or None for each of 2"),
        ({"confidence": [0.5, 1.5]}, r"confidence: expected probabilities in \[0, 1\], found 1.5"),
    ],
)
def test_bad_tracks_say_what(changes, message):
    d = am.Detections.from_frames([0], [[[0.0, 0, 0], [1, 0, 0]]])
    with pytest.raises(am.ParameterError, match=message):
        am.Tracks(**{"detections": d, "labels": [0, 1], **changes})


def test_tracks_without_detections_are_kept():
    d = am.Detections.from_frames([0], [ONE])
    tracks = am.Tracks(detections=d, labels=[1], names=("unseen", "seen", None))
    assert tracks.n_tracks == 3
    assert tracks.lengths.tolist() == [0, 1, 0]
    order, offsets = tracks.by_track
    assert (order.tolist(), offsets.tolist()) == ([0], [0, 0, 1, 1])


MODELS = {
    "dwna": small_model(),
    "random walk": small_model(motion=am.RandomWalk(walk_sigma=0.1), termination="last"),
    "dwpa": small_model(motion=am.DWPA(increment_sigma=1.0, acceleration_prior_sigma=3.0)),
    "interacting": small_model(motion=interacting()),
    "linear": small_model(
        motion=am.model.LinearMotion(
            F=[[1, 0.1], [0, 0.9]], Q=np.eye(2) * 1e-3, H=[1, 0], step=0.1,
            prior_covariance=np.eye(2),
        )
    ),
}  # fmt: skip


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_toml_both_ways(model, tmp_path):
    path = tmp_path / "model.toml"
    text = model.to_toml(path)
    assert path.read_text(encoding="utf-8") == text
    again = am.TrackingModel.from_toml(path)
    assert again == model
    assert hash(again) == hash(model)
    assert again.to_toml() == text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("noise_sigma", "noise_sgima", "Did you mean 'noise_sigma'"),
        ("[sensor]", "[sensro]", "Did you mean 'sensor'"),
        ('kind = "dwna"', 'kind = "magic"', "model.motion.kind: expected one of dwna"),
        ("p_detection = 0.9", "p_detection = 1.5", r"p_detection: expected a number in \(0, 1\)"),
        ('kind = "dwna"', 'kind = ["dwna"]', "model.motion.kind: expected one of dwna"),
        ("max_gap = 4", "max_gap = 99999999999", "max_gap: expected a whole number"),
        ("noise_sigma = 0.005", "noise_sigma = 1e-300", "noise_sigma: expected a number"),
        ("max_gap = 4", "max_gap = 2.5", "max_gap: expected a whole number"),
        ("max_speed = 4.0", "", "model.population.max_speed: expected a value, found nothing"),
        ("[motion]", "[motion", "expected TOML"),
        (
            'termination = "marginal"',
            'termination = "soon"',
            "expected one of marginal, last",
        ),
    ],
)
def test_a_bad_model_file_is_named_with_the_place(old, new, message, tmp_path):
    path = tmp_path / "model.toml"
    text = small_model().to_toml()
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(am.FormatError, match=message) as caught:
        am.TrackingModel.from_toml(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: am.DWNA(acceleration_sigma=0), "acceleration_sigma"),
        (lambda: am.RandomWalk(walk_sigma=float("nan")), "walk_sigma"),
        (lambda: am.DWNA(acceleration_sigma=True), "acceleration_sigma: expected a number"),
        (
            lambda: am.model.LinearMotion(F=np.eye(2), Q=-np.eye(2), H=[1, 0], step=1,
                                    prior_covariance=np.eye(2)),
            "Q: expected a positive semi-definite",
        ),
        (
            lambda: am.model.LinearMotion(F=np.eye(2), Q=np.eye(2), H=[0, 0], step=1,
                                    prior_covariance=np.eye(2)),
            "H: expected a row that sees the state",
        ),
        (
            lambda: am.InteractingMotions(
                models=(am.DWNA(acceleration_sigma=1), am.RandomWalk(walk_sigma=1)),
                transitions=[[0.5, 0.5], [0.5, 0.5]],
            ),
            "single motions of one kind",
        ),
        (
            lambda: am.InteractingMotions(
                models=(am.DWNA(acceleration_sigma=1),) * 2, transitions=[[0.5, 0.4], [0.5, 0.5]]
            ),
            "rows that sum to 1",
        ),
    ],
)  # fmt: skip
def test_bad_motions_say_what(make, message):
    with pytest.raises(am.ParameterError, match=message):
        make()


def test_matrices_for_one_step_refuse_what_they_do_not_describe():
    motion = MODELS["linear"].motion.modes[0]
    F = motion.transition([0.1, 0.3])
    assert np.allclose(F[1], np.linalg.matrix_power(F[0], 3))
    Q = motion.process_noise([0.2])[0]
    assert np.allclose(Q, F[0] @ motion.process_noise([0.1])[0] @ F[0].T + np.eye(2) * 1e-3)
    with pytest.raises(am.ParameterError, match="times the motion model's step"):
        motion.transition([0.15])


def test_errors_survive_a_process_boundary():
    import pickle

    for error in (
        am.ParameterError("a", "b", "c", "d"),
        am.FormatError("f.c3d", "byte 3", "x", "y", "z"),
        am.SolverLimit("pairs", 3, 2, "less"),
    ):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again)) == (type(error), str(error))


def _named_tracks():
    at = [[[0, 0, 1], [1, 1, 1]], [[np.nan] * 3, [1, 1, 2]], [[0, 0, 3], [1, 1, 3]]]
    return am.Tracks.from_dense([0, 0.01, 0.02], at, ["LKNE", None])


def test_tracks_are_a_sequence_of_positions_by_number_and_by_name():
    tracks = _named_tracks()
    assert len(tracks) == tracks.n_tracks == 2
    np.testing.assert_array_equal(tracks["LKNE"], tracks.positions()[:, 0])
    np.testing.assert_array_equal(tracks[-1], tracks.positions()[:, 1])
    for k, positions in enumerate(tracks):
        np.testing.assert_array_equal(positions, tracks.positions()[:, k])
    assert tracks.display_names == ("LKNE", "track 1")
    with pytest.raises(KeyError, match="no track named 'RKNE': LKNE, track 1"):
        tracks["RKNE"]
    with pytest.raises(IndexError):
        tracks[2]


def test_selected_tracks_have_their_own_detections_in_the_order_asked_for():
    scene = am.simulate.corrupt(am.simulate.cube(seed=1), missing=0.2, clutter=0.2, seed=1)
    whole = dataclasses.replace(scene, confidence=np.linspace(0, 1, len(scene.labels)))
    few = whole.select([5, 2])
    assert (few.labels >= 0).all()
    np.testing.assert_array_equal(few.positions(), whole.positions()[:, [5, 2]])
    for k, original in enumerate((5, 2)):
        np.testing.assert_array_equal(
            few.confidence[few.labels == k], whole.confidence[whole.labels == original]
        )
    with pytest.raises(KeyError, match="no track named 'LKNE'"):
        whole.select(["LKNE"])
    with pytest.raises(IndexError):
        whole.select([99])


def test_a_part_has_the_same_tracks_in_fewer_frames():
    whole = am.simulate.corrupt(am.simulate.cube(seed=1), missing=0.2, clutter=0.2, seed=1)
    part = whole.part(3, 9)
    assert part.names == whole.names
    np.testing.assert_array_equal(part.positions(), whole.positions()[3:9])
    np.testing.assert_array_equal(part.detections.counts, whole.detections.counts[3:9])


def test_kept_detections_stay_in_their_frames():
    d = am.simulate.cube(seed=1).detections
    is_kept = np.random.default_rng(1).random(d.n_points) < 0.5
    kept = d.keep(is_kept)
    np.testing.assert_array_equal(kept.points, d.points[is_kept])
    np.testing.assert_array_equal(kept.frame_of, d.frame_of[is_kept])
    np.testing.assert_array_equal(kept.times, d.times)
    with pytest.raises(am.ParameterError, match="is_kept"):
        d.keep([True])


def test_gaps_are_between_detections_of_a_track():
    assert _named_tracks().gaps() == (am.model.Gap(track=0, first=1, last=1, seconds=0.02),)
    rng = np.random.default_rng(3)
    seen = rng.random((200, 7)) < 0.6
    at = np.where(seen[..., None], rng.normal(size=(200, 7, 3)), np.nan)
    tracks = am.Tracks.from_dense(np.arange(200) / 100, at)
    missed = {(gap.track, t) for gap in tracks.gaps() for t in range(gap.first, gap.last + 1)}
    wanted = set()
    for k in range(7):
        there = np.flatnonzero(seen[:, k])
        wanted |= {(k, t) for t in range(there[0], there[-1]) if not seen[t, k]}
    assert missed == wanted


def test_tracks_become_tables():
    tracks = dataclasses.replace(_named_tracks(), confidence=[0.5, 1, 1, 1, 1])
    frame = pytest.importorskip("pandas", reason="the extra [tables] is not installed")
    table = tracks.to_pandas()
    assert isinstance(table, frame.DataFrame)
    assert table[table.name == "LKNE"].z_m.tolist() == [1, 3]
    assert table.confidence.tolist() == [0.5, 1, 1, 1, 1]
    assert table.time_s.tolist() == [0, 0, 0.01, 0.02, 0.02]
    array = tracks.to_xarray()
    assert array.sel(marker="LKNE", axis="z").values.tolist()[::2] == [1, 3]
    assert array.dims == ("time", "marker", "axis")
    clutter = dataclasses.replace(tracks, labels=[-1] * 5).to_pandas()
    assert set(clutter.track) == {-1}
    assert set(clutter.name) == {""}


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(am.ParameterError, match=r"pip install 'asterism\[tables\]'"):
        _named_tracks().to_pandas()


def test_a_notebook_shows_tracks_as_a_table():
    shown = dataclasses.replace(_named_tracks(), names=("<b>", None))._repr_html_()
    assert "&lt;b&gt;" in shown
    assert "<td>2</td><td>1</td><td>0</td><td>2</td>" in shown
