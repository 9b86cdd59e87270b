"""Wrong detections of tracks, and labels of a file that are wrong themselves."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from tests.paths import ROOT

sys.path.append(str(ROOT / "benchmarks"))

from wrong import wrong_runs

FIRST, LAST = 100, 139
PAIR = 3, 12


def exchanged(truth: am.Tracks) -> am.Tracks:
    """Exchange the labels of two markers in some frames."""
    frame, labels = truth.detections.frame_of, truth.labels.copy()
    inside = (frame >= FIRST) & (frame <= LAST)
    for one, other in (PAIR, PAIR[::-1]):
        labels[inside & (truth.labels == one)] = other
    return replace(truth, labels=labels)


@pytest.mark.parametrize("corrupted", [False, True])
def test_exchanged_tracks_are_switches_and_exchanged_labels_are_errors(corrupted):
    truth = am.simulate.person(frames=300, n_markers=40, seed=2)
    if corrupted:
        truth = am.simulate.corrupt(truth, missing=0.05, noise=3e-4, seed=2)
    wrong = exchanged(truth)
    for tracks, labels, kind in ((wrong, truth, "switch"), (truth, wrong, "label error")):
        runs = wrong_runs(tracks, labels)
        assert {run.track for run in runs} == set(PAIR)
        assert {run.kind for run in runs} == {kind}
        assert min(run.first for run in runs) == FIRST
        assert max(run.last for run in runs) == LAST


def with_gaps(made: am.Tracks) -> am.Tracks:
    """Occlude the two markers around the first and the last frame of the exchange."""
    positions = made.positions()
    for at in (FIRST, LAST):
        positions[at - 6 : at + 7, PAIR] = np.nan
    return am.Tracks.from_dense(made.detections.times, positions)


def test_a_label_that_changes_in_a_gap_is_an_error_by_its_distances():
    truth = with_gaps(am.simulate.person(frames=300, n_markers=40, seed=2))
    wrong = exchanged(truth)
    assert {run.kind for run in wrong_runs(wrong, truth)} == {"switch"}
    assert {run.kind for run in wrong_runs(truth, wrong)} == {"label error"}


def test_a_switch_within_labels_that_are_wrong_is_judged_on_its_own():
    truth = with_gaps(am.simulate.person(frames=300, n_markers=40, seed=2))
    frame, labels = truth.detections.frame_of, truth.labels.copy()
    one, third = PAIR[0], 20
    inside = (frame >= 115) & (frame < 120)
    labels[inside & (truth.labels == one)] = -1
    labels[inside & (truth.labels == third)] = one
    runs = wrong_runs(replace(truth, labels=labels), exchanged(truth))
    found = [(run.kind, run.first, run.last) for run in runs if run.track == one]
    assert found == [
        ("label error", 107, 114), ("switch", 115, 119), ("label error", 120, 132)
    ]  # fmt: skip


def test_two_markers_in_one_place_are_no_switch():
    truth = am.simulate.person(frames=300, n_markers=40, seed=2)
    positions = truth.positions()
    one, other = PAIR
    positions[FIRST : LAST + 1, other] = positions[FIRST : LAST + 1, one] + 1e-3
    truth = am.Tracks.from_dense(truth.detections.times, positions)
    assert {run.kind for run in wrong_runs(exchanged(truth), truth)} == {"label error"}


@pytest.mark.parametrize(("share", "kind"), [(0.5, "label error"), (0.2, "switch")])
def test_a_blob_of_two_merged_markers_is_either(share, kind):
    truth = am.simulate.person(frames=300, n_markers=40, seed=2)
    positions = truth.positions()
    one, other = PAIR
    at = np.arange(FIRST, FIRST + 4)
    positions[at, one] += share * (positions[at, other] - positions[at, one])
    positions[at, other] = np.nan
    truth = am.Tracks.from_dense(truth.detections.times, positions)
    inside = np.isin(truth.detections.frame_of, at) & (truth.labels == one)
    labels = np.where(inside, other, truth.labels).astype(truth.labels.dtype)
    runs = wrong_runs(replace(truth, labels=labels), truth)
    assert [(run.track, run.kind) for run in runs] == [(other, kind)]


def test_labels_that_change_in_a_long_gap_are_judged_at_the_other_end():
    """In the gap are pieces of both, which do not continue each other; no distances show more."""
    made = am.simulate.person(frames=300, n_markers=40, seed=2).positions()[:, [*PAIR, 0, 1]]
    positions = made.copy()
    positions[FIRST - 40 : FIRST, :2] = np.nan
    for marker, first in ((0, FIRST - 30), (1, FIRST - 28)):
        positions[first : first + 2, marker] = made[first : first + 2, marker]
    truth = am.Tracks.from_dense(np.arange(300) / 100, positions)
    frame, labels = truth.detections.frame_of, truth.labels.copy()
    inside = (frame >= FIRST) & (frame <= LAST) & (labels < 2)
    labels[inside] = 1 - labels[inside]
    in_gap = (frame >= FIRST - 40) & (frame < FIRST)
    found = np.where(in_gap, -1, truth.labels).astype(labels.dtype)
    runs = wrong_runs(replace(truth, labels=found), replace(truth, labels=labels))
    assert [(run.track, run.first, run.kind) for run in runs] == [
        (marker, FIRST, "label error") for marker in (0, 1)
    ]  # fmt: skip


def test_an_exchange_where_two_markers_meet_is_a_switch():
    """The motion is continuous either way."""
    t = np.arange(300) / 100
    along = 1.5 * (t - t[200])
    positions = np.zeros((300, 2, 3))
    positions[:, 0, 0] = positions[:, 1, 1] = along
    positions[:, 1, 2] = 0.002
    truth = am.Tracks.from_dense(t, positions)
    exchanged = truth.detections.frame_of >= 200
    labels = np.where(exchanged, 1 - truth.labels, truth.labels).astype(truth.labels.dtype)
    runs = wrong_runs(replace(truth, labels=labels), truth)
    assert {(run.track, run.first, run.kind) for run in runs} == {
        (0, 200, "switch"), (1, 200, "switch")
    }  # fmt: skip


def test_labels_are_judged_as_in_the_file():
    """Of the labels of every third frame, one is wrong, and the detections before are missed."""
    file = am.simulate.person(activity="run", frames=300, n_markers=40, seed=2)
    wrong = exchanged(file)
    labels_at = [
        am.simulate.corrupt(each, missing=0.3, noise=3e-4, stride=3, seed=2)
        for each in (file, wrong)
    ]
    assert {run.kind for run in wrong_runs(*labels_at, wrong)} == {"label error"}
    assert {run.kind for run in wrong_runs(*labels_at[::-1], file)} == {"switch"}


@pytest.mark.parametrize("from_file", [False, True])
def test_no_label_of_simulated_people_is_found_wrong(from_file):
    made = am.simulate.person(activity="run", frames=300, seed=31)
    truth = am.simulate.corrupt(made, missing=0.1, clutter=0.1, noise=3e-4, stride=3, seed=31)
    tracks = am.track(truth.detections, am.GNN(), stitch=True)
    kinds = [run.kind for run in wrong_runs(tracks, truth, made if from_file else None)]
    assert kinds.count("switch") > 20
    assert "label error" not in kinds
