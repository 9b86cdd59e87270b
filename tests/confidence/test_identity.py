"""What the confidence of identity means, what keeps it, and the decisions that list it."""

from __future__ import annotations

import csv
import functools
import json
from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism.io.decisions import decision_rows, write_decisions
from asterism.simulate import Burst, Ghosts
from asterism.tracking.confidence import assess
from tests.contracts.methods import each_method
from tests.scenes import moving, small_model, wanderers


@functools.cache
def bursts(frames=400):
    """A person in bursts of missed detections, with the tracks of the default path."""
    truth = am.simulate.corrupt(
        am.simulate.person(activity="run", frames=frames, seed=41),
        burst=Burst(), ghosts=Ghosts(), noise=3e-4, stride=2, seed=41,
    )  # fmt: skip
    return truth, am.track(truth.detections, fill=True)


ROUNDED = 0.5e-4 + 1e-9  # half of the last decimal of the table


def is_sound(tracks: am.Tracks) -> bool:
    """Return whether all probabilities are possible, and clutter has no identity."""
    clutter = tracks.labels < 0
    for confidence in (tracks.confidence, tracks.identity_confidence):
        assert confidence is not None
        assert ((confidence >= 0) & (confidence <= 1)).all()
    assert (tracks.identity_confidence[clutter] == 0).all()
    for each in tracks.decisions:
        if each.probability is None:
            assert each.kind in ("cut", "fill")
            continue
        others = [other.probability for other in each.alternatives]
        assert 0 <= each.probability <= 1
        assert all(0 <= p <= 1 for p in others)
        assert sum(others) <= 1 - each.probability + 1e-9
        assert sorted(others, reverse=True) == others
    return True


def exchanged(n_frames=300, first=150, last=250, n_missed=8):
    """A rigid body of which two near tracks are exchanged for a third of their detections."""
    rng = np.random.default_rng(1)
    shape = rng.uniform(-0.3, 0.3, (8, 3))
    shape[1] = shape[0] + [0.09, 0, 0]
    t, positions = moving(shape, n_frames, seed=3, noise=3e-4)
    for cut in (first, last):  # both are occluded at the exchange
        positions[cut - n_missed : cut, :2] = np.nan
    positions[first:last, [0, 1]] = positions[first:last, [1, 0]]
    return am.Tracks.from_dense(t, positions)


def test_a_track_on_another_marker_is_uncertain_there_alone():
    tracks = exchanged()
    found = assess(tracks, am.estimate_model(tracks.detections).model)
    frame, sure = tracks.detections.frame_of, found.identity_confidence
    is_pair = tracks.labels < 2
    inside = is_pair & (frame >= 150) & (frame < 250)
    assert sure[inside].max() < 0.3
    assert sure[is_pair & ~inside].min() > 0.9
    assert sure[~is_pair].min() > 0.99
    listed = {each.track: each for each in found.decisions if each.probability < 0.5}
    assert set(listed) == {0, 1}
    assert {each.track for each in found.decisions} == {0, 1}
    for k, each in listed.items():
        assert (each.first, each.last) == (150, 241)
        assert each.alternatives[0].track == 1 - k
        assert each.alternatives[0].probability > 0.5
    assert is_sound(found)


def test_a_link_that_leaps_to_an_unknown_marker_is_uncertain():
    n_frames, lost, found_again = 230, 200, 204
    rng = np.random.default_rng(1)
    shape = rng.uniform(-0.3, 0.3, (9, 3))
    shape[8] = shape[0] + [0.09, 0, 0]
    t, positions = moving(shape, n_frames, seed=3, noise=3e-4)
    positions[found_again:, 0] = positions[found_again:, 8]  # which no other track holds
    positions[lost:found_again, 0] = np.nan
    tracks = am.Tracks.from_dense(t, positions[:, :8])
    found = assess(tracks, am.estimate_model(tracks.detections).model)
    frame, sure = tracks.detections.frame_of, found.identity_confidence
    inside = (tracks.labels == 0) & (frame >= found_again)
    assert sure[inside].max() < 0.8
    assert sure[~inside].min() > 0.9
    (listed,) = (each for each in found.decisions if each.probability < 0.8)
    assert (listed.track, listed.first, listed.last) == (0, found_again, n_frames - 1)
    assert listed.alternatives[0].track is None


def test_a_gap_of_straight_motion_is_no_leap():
    shape = np.random.default_rng(1).uniform(-0.3, 0.3, (8, 3))
    t, positions = moving(shape, 300, seed=3, noise=3e-4)
    for k in range(8):
        positions[30 * k + 20 : 30 * k + 24, k] = np.nan
    tracks = am.Tracks.from_dense(t, positions)
    found = assess(tracks, am.estimate_model(tracks.detections).model)
    assert found.decisions == ()


def test_a_perfect_capture_has_no_decision():
    for truth in (am.simulate.cube(frames=100, seed=1), exchanged(n_missed=0, first=0, last=300)):
        tracks = am.track(truth.detections)
        assert tracks.decisions == ()
        assert tracks.identity_confidence.min() > 0.99


@each_method
@pytest.mark.parametrize("stitch", [False, True])
def test_every_method_returns_both_confidences(method, stitch):
    truth = wanderers(np.random.default_rng(11), clutter=1.5, missing=0.2)
    tracks = am.track(truth.detections, method, model=small_model(), stitch=stitch)
    assert tracks.n_tracks > 3
    assert is_sound(tracks)
    inside = tracks.labels >= 0
    assert tracks.confidence[inside].min() > 0
    assert tracks.identity_confidence[inside].min() > 0


@pytest.mark.parametrize("name", ["jpda", "mht", "mcmcda"])
def test_a_method_keeps_its_own_confidence(name):
    truth = wanderers(np.random.default_rng(12), clutter=1.5)
    model = small_model()
    method = am.tracking.method_by_name(name)
    tracks = am.track(truth.detections, method, model=model, stitch=False)
    bare = replace(tracks, confidence=None, identity_confidence=None, decisions=())
    by_motion = assess(bare, model)
    assert (tracks.confidence != by_motion.confidence).any()
    assert (assess(tracks, model).confidence == tracks.confidence).all()


def test_a_method_without_confidence_gets_that_of_the_motion_model():
    # They meet at rest in frame 10, and part again.
    frames = [[[0.002 * x**2, 0.001 * x, 0], [-0.002 * x**2, 0, 0]] for x in range(-10, 10)]
    d = am.Detections.from_frames(0.1 * np.arange(20), frames)
    tracks = am.track(d, am.GNN(), model=small_model(), stitch=False)
    assert (tracks.labels >= 0).all()
    assert tracks.confidence.min() < 0.9
    assert tracks.confidence[d.frame_of < 5].min() > 0.95
    uncertain = d.frame_of[tracks.confidence < 0.9]
    assert abs(uncertain - 10).max() <= 4


def test_parts_selections_and_measured_detections_keep_the_confidences():
    _, tracks = bursts()
    d = tracks.detections
    assert d.filled is not None
    part = slice(d.offsets[50], d.offsets[90])
    for name in ("confidence", "identity_confidence"):
        values = getattr(tracks, name)
        assert (getattr(tracks.part(50, 90), name) == values[part]).all()
        chosen = tracks.select([3, 1])
        assert (getattr(chosen, name) == values[np.isin(tracks.labels, [1, 3])]).all()
        assert (getattr(tracks.measured(), name) == values[~d.filled]).all()


def test_a_fill_is_as_certain_as_the_less_certain_of_its_ends():
    _, tracks = bursts()
    order, _ = tracks.by_track
    sure, filled = tracks.identity_confidence[order], tracks.detections.filled[order]
    runs = np.flatnonzero(np.diff(np.concatenate([[0], filled.astype(int), [0]]))).reshape(-1, 2)
    assert len(runs) > 10
    for begin, end in runs:
        assert (sure[begin:end] == min(sure[begin - 1], sure[end])).all()


def test_probabilities_of_a_capture_with_all_kinds_of_decisions_are_sound():
    _, tracks = bursts()
    assert is_sound(tracks)
    kinds = {each.kind for each in tracks.decisions}
    assert {"identity", "join", "fill"} <= kinds


def test_identities_are_as_often_right_as_the_confidence_has_it():
    truth, tracks = bursts()
    tracks = tracks.measured()
    inside = tracks.labels >= 0
    counts = np.zeros((tracks.n_tracks, truth.n_tracks + 1), dtype=int)
    np.add.at(counts, (tracks.labels[inside], truth.labels[inside]), 1)
    counts[:, -1] = 0  # clutter
    right = truth.labels[inside] == counts.argmax(axis=1)[tracks.labels[inside]]
    curve = am.metrics.calibration_curve(tracks.identity_confidence[inside], right)
    assert curve.ece < 0.03


def test_the_number_of_threads_changes_nothing():
    truth = wanderers(np.random.default_rng(13), n_frames=60, clutter=1.5)
    one, two = (
        am.track(truth.detections, am.MCMCDA(threads=n), model=small_model(), stitch=True, seed=1)
        for n in (1, 2)
    )
    assert (one.confidence == two.confidence).all()
    assert (one.identity_confidence == two.identity_confidence).all()
    assert one.decisions == two.decisions


def test_a_repeated_run_gives_the_same_decisions():
    truth, tracks = bursts(frames=200)
    assert {"identity", "join", "fill"} <= {each.kind for each in tracks.decisions}
    again = am.track(truth.detections, fill=True)
    assert again.identity_confidence.tobytes() == tracks.identity_confidence.tobytes()
    assert again.decisions == tracks.decisions


def test_decisions_are_written_as_they_are(tmp_path):
    _, tracks = bursts()
    am.write(tracks, tmp_path / "tracks.csv")
    kept = am.io.read_tracks(tmp_path / "tracks.csv")
    assert kept.identity_confidence.tobytes() == tracks.identity_confidence.tobytes()
    write_decisions(tracks, tmp_path / "decisions.csv")
    write_decisions(tracks, tmp_path / "decisions.json")
    rows = json.loads((tmp_path / "decisions.json").read_text())
    with (tmp_path / "decisions.csv").open() as file:
        texts = list(csv.DictReader(file))
    assert len(rows) == len(texts) == len(tracks.decisions)
    for row, text, each in zip(rows, texts, tracks.decisions, strict=True):
        assert row["kind"] == text["kind"] == each.kind
        assert row["track"] == int(text["track"]) == each.track
        if each.probability is None:
            assert (row["probability"], text["probability"]) == (None, "")
        else:
            assert row["probability"] == pytest.approx(each.probability, abs=ROUNDED)
            assert float(text["probability"]) == row["probability"]
        assert [o["probability"] for o in row["alternatives"]] == pytest.approx(
            [o.probability for o in each.alternatives], abs=ROUNDED
        )
        assert text["alternatives"].count(";") == max(len(each.alternatives) - 1, 0)


def test_frames_of_decisions_are_those_of_the_file():
    _, tracks = bursts()
    d = tracks.detections
    capture = am.Capture(
        times=d.times, offsets=d.offsets, points=d.points, labels=tracks.labels,
        names=tracks.names, first_frame=321,
    )  # fmt: skip
    rows = decision_rows(replace(tracks, detections=capture))
    for row, each in zip(rows, tracks.decisions, strict=True):
        assert (row["first_frame"], row["last_frame"]) == (321 + each.first, 321 + each.last)
        assert row["start_s"] == d.times[each.first]
    assert decision_rows(tracks)[0]["first_frame"] == 1 + tracks.decisions[0].first


def test_a_c3d_lists_at_most_255_decisions(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    _, tracks = bursts()
    assert len(tracks.decisions) < 255
    for n in (1, 20):
        many = replace(tracks, decisions=tracks.decisions * n)
        am.write(many, tmp_path / "a.c3d")
        group = ezc3d.c3d(str(tmp_path / "a.c3d"))["parameters"]["DECISIONS"]
        lines = group["LINES"]["value"]
        assert len(lines) == min(255, len(many.decisions))
        assert int(group["NUMBER"]["value"][0]) == len(many.decisions)
        assert max(map(len, lines)) <= 120
    assert lines[0].startswith("identity ")
    am.write(replace(tracks, decisions=()), tmp_path / "a.c3d")
    assert "DECISIONS" not in ezc3d.c3d(str(tmp_path / "a.c3d"))["parameters"]


def test_a_short_track_is_less_certain_than_a_long_one_and_is_listed():
    t, positions = moving(np.random.default_rng(2).uniform(-0.3, 0.3, (6, 3)), 200, seed=4)
    positions[8:, 5] = np.nan  # eight detections, as ghosts leave them
    truth = am.Tracks.from_dense(t, positions, tuple("abcdef"))
    tracks = assess(truth, small_model())
    short = tracks.labels == 5
    assert short.sum() == 8
    assert tracks.identity_confidence[short].max() < 0.99
    assert tracks.identity_confidence[~short].min() > 0.999
    (own,) = (each for each in tracks.decisions if each.kind == "identity")
    assert (own.track, own.first, own.last, own.n_detections) == (5, 0, 7, 8)
    assert [other.track for other in own.alternatives] == [None]
    assert own.probability == pytest.approx(tracks.identity_confidence[short][0])


def test_a_short_track_with_an_uncertain_link_is_no_more_certain_than_one_without():
    t, positions = moving(np.random.default_rng(2).uniform(-0.3, 0.3, (6, 3)), 200, seed=4)
    positions[5:, 5] = np.nan  # too few detections for distances
    tracks = am.Tracks.from_dense(t, positions)
    link = np.ones(len(tracks.labels))
    link[(tracks.labels == 5) & (tracks.detections.frame_of == 3)] = 0.9
    model = small_model()
    whole, cut = (
        assess(replace(tracks, confidence=each), model).identity_confidence[tracks.labels == 5]
        for each in (np.ones_like(link), link)
    )
    assert (cut < whole).all()
    assert cut[3:].max() < 0.9 * cut[:3].min() + 1e-9
