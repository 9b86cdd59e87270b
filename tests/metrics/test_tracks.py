"""Tracks against truth: finding the same detections, the rules for names, the oracle."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import asterism as am
from asterism.errors import ParameterError
from asterism.metrics import align, evaluate, oracle_tracks
from asterism.metrics.matching import same_detections
from asterism.model import Detections, Tracks
from asterism.simulate import Burst, corrupt, cube, smooth


def _truth(seed=0, **switches):
    truth = smooth(n_markers=8, frames=60, rate=100, seed=seed)
    return corrupt(truth, **{"missing": 0.1, "clutter": 0.1, "noise": 0.001, **switches}, seed=seed)


def _result(truth, seed=0):
    """Give labels that are wrong in every way: broken, swapped, on clutter and missing."""
    rng = np.random.default_rng(seed)
    labels = oracle_tracks(truth, 2).labels.copy()
    frame_of = truth.detections.frame_of
    a, b = (np.flatnonzero((labels == k) & (frame_of > 30)) for k in labels[frame_of == 30][:2])
    labels[a], labels[b] = labels[b[:1]], labels[a[:1]]
    labels[rng.random(len(labels)) < 0.05] = -1
    spare = np.flatnonzero(truth.labels < 0)[::2]
    labels[spare] = labels.max() + 1 + np.arange(len(spare))
    return Tracks(detections=truth.detections, labels=labels)


def _moved(tracks, points=None, times=None, order=None):
    d = tracks.detections
    order = np.arange(d.n_points) if order is None else order
    points = d.points if points is None else points
    times = d.times if times is None else times
    moved = Detections(times=times, offsets=d.offsets, points=points[order])
    return Tracks(detections=moved, labels=tracks.labels[order], names=tracks.names)


def _chosen(tracks, is_in):
    d = tracks.detections
    counts = np.bincount(d.frame_of[is_in], minlength=d.n_frames)
    part = Detections(
        times=d.times, offsets=np.concatenate([[0], np.cumsum(counts)]), points=d.points[is_in]
    )
    return Tracks(detections=part, labels=tracks.labels[is_in], names=tracks.names)


def _shuffle(tracks, seed):
    d = tracks.detections
    return np.lexsort((np.random.default_rng(seed).random(d.n_points), d.frame_of))


def test_truth_is_perfect_against_itself():
    truth = _truth()
    found = evaluate(truth, truth)
    assert (found.idf1, found.mota, found.hota) == (1, 1, 1)
    assert found.wrong_percent == found.missing_percent == found.clutter_labelled_percent == 0
    assert found.n_true == (truth.labels >= 0).sum()
    assert np.array_equal(found.times, truth.detections.times)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("as_in_file", ["float32 mm", "float32 m", "text"])
def test_the_way_through_a_file_changes_nothing(seed, as_in_file):
    truth = _truth(seed)
    result = _result(truth)
    before = evaluate(result, truth)
    assert 0 < before.idf1 < 1
    points = truth.detections.points
    points = {
        "float32 mm": (1000 * points).astype(np.float32) * 0.001,
        "float32 m": points.astype(np.float32).astype(np.float64),
        "text": np.round(1000 * points, 4) / 1000,
    }[as_in_file]
    times = np.round(truth.detections.times, 5) + 1e-4
    after = evaluate(_moved(result, points, times, _shuffle(result, seed)), truth)
    assert after.to_dict() == before.to_dict()
    for name, column in before.by_frame().items():
        if name != "times":
            assert np.array_equal(column, after.by_frame()[name]), name


def test_far_from_the_origin_a_file_rounds_more():
    truth = _truth()
    far = _moved(truth, truth.detections.points + 40.0)
    back = _moved(far, (1000 * far.detections.points).astype(np.float32) * 0.001)
    assert evaluate(back, far).idf1 == 1
    back = _moved(far, far.detections.points.astype(np.float32).astype(np.float64))
    assert evaluate(back, far).idf1 == 1


def test_detections_of_one_side_are_missed_or_false():
    truth = _truth()
    everything = _result(truth)
    rng = np.random.default_rng(1)
    is_in = rng.random(len(truth.labels)) < 0.8
    lost = Tracks(
        detections=truth.detections, labels=np.where(is_in, everything.labels, -1)
    )  # as if the labels of the lost ones had been taken away
    found, expected = evaluate(_chosen(everything, is_in), truth), evaluate(lost, truth)
    assert found.to_dict() == expected.to_dict()

    unknown = Tracks(
        detections=truth.detections, labels=np.where(is_in, truth.labels, -1), names=truth.names
    )
    found, expected = evaluate(everything, _chosen(truth, is_in)), evaluate(everything, unknown)
    assert found.false_labels == expected.false_labels
    assert found.idf1 == expected.idf1
    assert found.wrong_percent == expected.wrong_percent


def test_frames_of_one_side_are_kept_in_the_order_of_time():
    truth = _truth(missing=0.0, clutter=0.0)
    half = corrupt(truth, stride=2)
    found = evaluate(half, truth)
    assert len(found.times) == 60
    assert found.missing_percent == 50
    assert found.by_frame()["missed"].tolist() == [0, 8] * 30
    turned = evaluate(truth, half)
    assert np.array_equal(turned.times, truth.detections.times)
    assert turned.by_frame()["false"].tolist() == [0, 8] * 30
    assert (turned.idr, turned.switches) == (1, 0)


def test_points_at_one_place_are_matched_in_order():
    times, place = [0.0, 1.0], [[0.5, 0, 0]] * 3
    d = Detections.from_frames(times, [place, [*place, [0, 1, 2]]])
    other = Detections.from_frames(times, [place, [[0, 1, 2], *place]])
    i, j = same_detections(d, other, 1e-6)
    assert i.tolist() == list(range(7))
    assert j.tolist() == [0, 1, 2, 4, 5, 6, 3]


def test_the_nearest_of_two_near_ones_is_the_same():
    d = Detections.from_frames([0.0], [[[0, 0, 0], [3e-4, 0, 0]]])
    other = Detections.from_frames([0.0], [[[2.5e-4, 0, 0], [1e-4, 0, 0]]])
    i, j = same_detections(d, other, 1e-3)
    assert (i.tolist(), j.tolist()) == ([0, 1], [1, 0])
    # And the tolerance is one: at 0.2 mm still both, at 0.07 only the nearer, at 0.01 none.
    assert len(same_detections(d, other, 2e-4)[0]) == 2
    assert len(same_detections(d, other, 7e-5)[0]) == 1
    assert len(same_detections(d, other, 1e-5)[0]) == 0


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([2, 3]))
def test_matching_equals_a_loop_over_frames(seed, n_axes):
    rng = np.random.default_rng(seed)
    # A coarse grid, so that points share coordinates and places.
    frames = [rng.integers(0, 3, (rng.integers(0, 6), n_axes)) * 0.1 for _ in range(6)]
    others = [
        np.concatenate([f[rng.permutation(len(f))[: rng.integers(0, 7)]] + rng.uniform(-4e-7, 4e-7),
                        rng.integers(0, 3, (rng.integers(0, 2), n_axes)) * 0.1])
        for f in frames
    ]  # fmt: skip
    empty = np.empty((0, n_axes))
    a = Detections.from_frames(np.arange(6.0), [f if len(f) else empty for f in frames])
    b = Detections.from_frames(np.arange(6.0), [f if len(f) else empty for f in others])
    i, j = same_detections(a, b, 1e-6)
    assert len(set(i.tolist())) == len(i)
    assert len(set(j.tolist())) == len(j)
    expected = 0
    for t in range(6):
        places_a = np.round(a.frame(t), 3).tolist() if a.n_points else []
        places_b = np.round(b.frame(t), 3).tolist() if b.n_points else []
        for place in {tuple(p) for p in places_a}:
            expected += min(places_a.count(list(place)), places_b.count(list(place)))
    assert len(i) == expected
    if len(i):
        assert (a.frame_of[i] == b.frame_of[j]).all()
        assert np.abs(a.points[i] - b.points[j]).max() < 1.1e-6


@pytest.mark.parametrize(
    "make",
    [
        lambda t: _moved(t, t.detections.points * 1000),
        lambda t: _moved(t, times=t.detections.times + 5),
        lambda t: _chosen(t, t.detections.frame_of < 20),
    ],
    ids=["other units", "other times", "a third of it"],
)
def test_another_capture_is_refused(make):
    truth = _truth()
    with pytest.raises(ParameterError, match="same capture"):
        evaluate(make(truth), truth)
    with pytest.raises(ParameterError, match="same capture"):
        evaluate(truth, make(truth))


def test_unnamed_truth_is_clutter_beside_names_only():
    d = Detections.from_frames([0.0, 0.1], [[[0, 0, 0], [1, 0, 0]]] * 2)
    result = Tracks(detections=d, labels=[0, 1, 0, 1])
    named = evaluate(result, Tracks(detections=d, labels=[0, 1, 0, 1], names=("A", None)))
    assert (named.n_true, named.false_labels, named.n_markers) == (2, 2, 1)
    assert named.clutter_labelled_percent == 100
    unnamed = evaluate(result, Tracks(detections=d, labels=[0, 1, 0, 1]))
    assert (unnamed.n_true, unnamed.false_labels, unnamed.idf1) == (4, 0, 1)
    assert (
        oracle_tracks(Tracks(detections=d, labels=[0, 1, 0, 1], names=("A", None)), 1).n_tracks == 1
    )


def test_names_of_the_result_do_not_matter():
    truth = _truth()
    names = tuple(reversed(truth.names))
    result = Tracks(detections=truth.detections, labels=truth.labels, names=names)
    assert evaluate(result, truth).idf1 == 1


def test_true_positions_enter_motp():
    exact = smooth(n_markers=8, frames=60, rate=100)
    truth = corrupt(exact, noise=0.002, missing=0.1, clutter=0.2, seed=3)
    places = np.full(truth.detections.points.shape, np.nan)
    is_true = truth.labels >= 0
    dense = exact.positions()
    places[is_true] = dense[truth.detections.frame_of[is_true], truth.labels[is_true]]
    found = evaluate(truth, truth, truth_positions=places)
    # The mean length of a normal vector in space is sigma sqrt(8 / pi).
    assert found.motp_mm == pytest.approx(2 * np.sqrt(8 / np.pi), rel=0.1)
    assert 0.002 < found.gospa < 0.03
    order = _shuffle(truth, 1)
    shuffled = evaluate(_moved(truth, order=order), truth, truth_positions=places)
    assert shuffled.motp_mm == pytest.approx(found.motp_mm)
    assert evaluate(truth, truth, truth_positions=places, c=1e-6).gospa < 1e-5 < found.gospa
    with pytest.raises(ParameterError, match="truth_positions"):
        evaluate(truth, truth, truth_positions=places[1:])


def test_nothing_against_nothing():
    nothing = Tracks(detections=Detections.from_frames([0, 1], [[], []]), labels=[])
    found = evaluate(nothing, nothing)
    assert np.isnan(found.idf1)
    other = Tracks(detections=Detections.from_frames([], []), labels=[])
    assert len(evaluate(nothing, other).times) == 2
    assert str(found)


def test_result_reads_as_text_json_and_table():
    truth = _truth()
    found = evaluate(_result(truth), truth)
    again = json.loads(json.dumps(found.to_dict()))
    assert json.dumps(again) == json.dumps(found.to_dict())  # NaN is equal to itself as text
    assert again["idf1"] == found.idf1
    assert again["frames_by_wrong"] == list(found.frames_by_wrong)
    columns = found.by_frame()
    assert {len(column) for column in columns.values()} == {60}
    assert {"times", "true", "missed", "false", "switches", "wrong", "gospa"} <= set(columns)
    text = str(found)
    assert f"{found.idf1:.4f}" in text
    assert f"{found.switches} (" in text
    assert len({line.index("  ") for line in text.splitlines()}) > 1
    assert repr(found).startswith("Evaluation(idf1=")


def test_filled_points_are_no_detections():
    seen = am.simulate.corrupt(am.simulate.person(frames=80, seed=2), missing=0.1, seed=2)
    tracks = am.track(seen.detections)
    filled = am.fill_gaps(tracks).tracks
    assert filled.detections.filled.sum() > 100
    expected, found = evaluate(tracks, seen), evaluate(filled, seen)
    assert found.filled == filled.detections.filled.sum()
    assert str(found.to_dict()) == str(expected.to_dict() | {"filled": found.filled})  # with NaN
    assert re.search(rf"filled points left out +{found.filled}\n", str(found))
    assert "filled" not in str(expected)
    # The truth may be filled too, and have true positions.
    places = filled.detections.points
    both = evaluate(filled, filled, truth_positions=places)
    assert (both.idf1, both.motp_mm) == (1.0, 0.0)


def test_alignment_says_which_is_which():
    truth = _truth()
    result = _moved(_result(truth), order=_shuffle(truth, 2))
    both = align(result, truth)
    assert (both.i_tracks >= 0).all()
    assert np.array_equal(
        result.detections.points[both.i_tracks], truth.detections.points[both.i_truth]
    )
    assert np.array_equal(both.labels, result.labels[both.i_tracks])
    assert np.array_equal(both.truth_labels, truth.labels[both.i_truth])
    assert (np.diff(both.frame_of) >= 0).all()


def test_package_may_be_called():
    # Importing a submodule first must not turn the function into something that cannot be called.
    code = (
        "import asterism, asterism.metrics.counts, asterism.simulate as s;"
        "t = s.cube(frames=3); assert asterism.evaluate(t, t).idf1 == 1"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def _slow_oracle(truth, max_gap):
    """Give the pieces as a set of tuples of detections."""
    pieces = set()
    frame_of = truth.detections.frame_of
    for k in range(truth.n_tracks):
        piece = []
        for i in np.flatnonzero(truth.labels == k).tolist():
            if piece and frame_of[i] - frame_of[piece[-1]] > max_gap:
                pieces.add(tuple(piece))
                piece = []
            piece.append(i)
        pieces.add(tuple(piece))
    return {p for p in pieces if len(p) > 1}


@pytest.mark.parametrize("max_gap", [1, 2, 3, 8])
@pytest.mark.parametrize("seed", range(3))
def test_the_oracle_equals_breaking_track_by_track(seed, max_gap):
    truth = _truth(seed, missing=0.4, burst=Burst(n=3))
    found = oracle_tracks(truth, max_gap)
    pieces = {tuple(np.flatnonzero(found.labels == k).tolist()) for k in range(found.n_tracks)}
    assert pieces == _slow_oracle(truth, max_gap)
    assert len(pieces) == found.n_tracks
    assert found.detections is truth.detections


def test_floor_of_the_reference_scene():
    # The reference figures: with a gap of 2 some 20 % wrong and 15.5 tracks, with 4 about 1 % and
    # 8.2 tracks, where all pieces of a marker but its longest count as wrong.
    def mean(max_gap):
        found = []
        for seed in range(40):
            truth = corrupt(cube(seed=seed), missing=0.1, clutter=0.1, noise=0.005, seed=seed)
            scores = evaluate(oracle_tracks(truth, max_gap), truth)
            found.append([100 * (1 - scores.idp), scores.n_tracks])
        return np.mean(found, axis=0)

    assert mean(2) == pytest.approx([20, 15.5], rel=0.12)
    wrong, n_tracks = mean(4)
    assert wrong < 1.1
    # A break takes four misses in a row after a detection, in about 95 places for each marker.
    assert n_tracks == pytest.approx(8 + 8 * 95 * 0.9 * 0.1**4, abs=0.1)


def test_floor_refuses_no_gap():
    with pytest.raises(ParameterError, match="max_gap"):
        oracle_tracks(_truth(), 0)
