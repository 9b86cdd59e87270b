"""Changes of tracks by a search, against the tracks as they were given."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts import absent_markers
from asterism.tracking.attempts.posterior import (
    gain_of_change,
    log_posterior,
    within_limits,
)
from asterism.tracking.attempts.probable_changes import _labels_of_markers, probable_changes

TRUTH = am.simulate.corrupt(
    am.simulate.person(activity="run", frames=240, seed=1),
    clutter=0.05, noise=3e-4, stride=2, seed=1,
)  # fmt: skip
FRAME, LABELS = TRUTH.detections.frame_of, TRUTH.labels
MODEL = am.tracking.tracklet_model(am.estimate_model(TRUTH.detections).model)
SHARED = am.tracking.learn_shared_acceleration(TRUTH, MODEL)


def changed(given, found):
    tracks = am.Tracks(detections=TRUTH.detections, labels=given)
    return probable_changes(tracks, found, MODEL, SHARED)


def exchanged(labels, first, second, begin, end):
    out, here = labels.copy(), (begin <= FRAME) & (end > FRAME)
    out[here & (labels == first)], out[here & (labels == second)] = second, first
    return out


def of(marker, begin, end):
    return (marker == LABELS) & (begin <= FRAME) & (end > FRAME)


def test_tracks_that_were_not_changed_stay():
    np.testing.assert_array_equal(changed(LABELS, LABELS), LABELS)


@pytest.mark.parametrize(("begin", "end"), [(40, 41), (40, 44), (40, 90), (100, 120)])
def test_an_exchange_is_taken_over_where_it_is_right(begin, end):
    wrong = exchanged(LABELS, 3, 5, begin, end)
    np.testing.assert_array_equal(changed(LABELS, wrong), LABELS)
    np.testing.assert_array_equal(changed(wrong, LABELS), LABELS)


def test_each_of_two_changes_is_judged_by_itself():
    given, found = exchanged(LABELS, 3, 5, 40, 44), exchanged(LABELS, 3, 5, 60, 64)
    np.testing.assert_array_equal(changed(given, found), LABELS)


def test_detections_are_taken_and_none_is_only_lost():
    some = np.random.default_rng(1).random(len(LABELS)) < 0.02
    fewer = np.where(some, -1, LABELS)
    found, is_lost = changed(fewer, LABELS), some & (LABELS >= 0)
    assert (found == LABELS)[is_lost].mean() > 0.95  # the others are less probable than clutter
    np.testing.assert_array_equal(found[~is_lost], LABELS[~is_lost])
    np.testing.assert_array_equal(changed(LABELS, fewer), LABELS)


def test_a_tracklet_without_a_label_is_of_the_absent_marker_that_fits():
    here = of(7, 50, 60)
    given, found = np.where(here, -1, LABELS), np.where(here, LABELS.max() + 1, LABELS)
    np.testing.assert_array_equal(changed(given, found), LABELS)


@pytest.mark.parametrize("is_compared", [True, False])
@pytest.mark.parametrize("n_frames", [2, 10, 40])
def test_an_object_that_is_no_marker_is_no_absent_marker(n_frames, is_compared, monkeypatch):
    """It moves steadily far from the neighbours of the marker that is absent meanwhile."""
    if not is_compared:  # neither by distances nor by the posterior
        monkeypatch.setattr(absent_markers, "MAX_DEVIATION", np.inf)
    d, here = TRUTH.detections, of(7, 40, 40 + n_frames)
    at = np.array([[3, 0.02 * t, 1] for t in range(n_frames)])
    first = d.offsets[40:][:n_frames]
    extra = am.Detections(
        times=d.times, points=np.insert(d.points, first, at, axis=0),
        offsets=d.offsets + np.clip(np.arange(d.n_frames + 1) - 40, 0, n_frames),
    )  # fmt: skip
    given = np.insert(np.where(here, -1, LABELS), first, -1)
    found = np.insert(np.where(here, -1, LABELS), first, LABELS.max() + 1)
    tracks = am.Tracks(detections=extra, labels=given)
    alone = am.Tracks(detections=extra, labels=np.where(found == found.max(), 0, -1))
    assert within_limits(alone, MODEL).n_tracks == 1
    np.testing.assert_array_equal(probable_changes(tracks, found, MODEL, SHARED), given)


def test_the_posterior_is_that_of_the_pieces_between_excluded_gaps():
    gap = of(7, 50, 60)
    cut = am.Tracks(detections=TRUTH.detections, labels=np.where(gap, -1, LABELS))
    pieces = within_limits(cut, MODEL)
    assert pieces.n_tracks == TRUTH.n_tracks + 1
    expected = (
        am.log_posterior(pieces, MODEL)
        + am.model.shared_gains(
            pieces,
            MODEL,
            SHARED,
            cut.labels[[np.argmax(pieces.labels == k) for k in range(pieces.n_tracks)]],
        ).sum()
    )
    assert log_posterior(cut, MODEL) == am.log_posterior(pieces, MODEL)
    assert log_posterior(cut, MODEL, SHARED) == pytest.approx(expected)
    assert log_posterior(cut, MODEL, SHARED) < log_posterior(TRUTH, MODEL, SHARED)


@pytest.mark.parametrize("begin", [0, 40, 100])
@pytest.mark.parametrize("change", [
    lambda begin: exchanged(LABELS, 3, 5, begin, begin + 4),
    lambda begin: np.where(of(30, begin, begin + 6), -1, LABELS),
    lambda begin: np.where(of(30, begin, 120), 44, np.where(LABELS == 44, -1, LABELS)),
])  # fmt: skip
def test_the_gain_of_a_change_is_that_of_the_whole_posterior(begin, change):
    wrong = change(begin)
    d, changed = TRUTH.detections, np.flatnonzero(wrong != LABELS)
    whole, other = (
        log_posterior(am.Tracks(detections=d, labels=labels), MODEL, SHARED)
        for labels in (LABELS, wrong)
    )
    assert gain_of_change(changed, LABELS, wrong, TRUTH, MODEL, SHARED) == pytest.approx(
        other - whole, abs=0.01
    )
    assert gain_of_change(changed, wrong, LABELS, TRUTH, MODEL, SHARED) == pytest.approx(
        whole - other, abs=0.01
    )


def test_tracklets_are_of_the_first_label_given_to_them():
    frame = np.array([0, 0, 1, 1, 2, 2, 3, 3, 4])
    given = np.array([-1, 1, 0, 1, 1, 0, 1, -1, -1])
    found = np.array([0, 1, 0, 1, 0, 1, 0, 1, 2])
    assert _labels_of_markers(found, given, frame).tolist() == [0, 1, 0, 1, 0, 1, 0, 1, -1]


def test_the_shorter_of_two_tracklets_in_a_frame_is_clutter():
    frame = np.array([0, 1, 1, 2, 3, 3, 4])
    given = np.array([3, 3, -1, 3, 3, -1, 3])
    found = np.array([0, 0, 1, 1, 2, 0, 2])
    # Track 0 is in frames 0, 1, 3, track 1 in 1 and 2, and track 2 in 3 and 4.
    assert _labels_of_markers(found, given, frame).tolist() == [3, 3, -1, -1, -1, 3, -1]


def test_there_may_be_no_tracks():
    none = np.full(len(LABELS), -1)
    np.testing.assert_array_equal(changed(none, none), none)
