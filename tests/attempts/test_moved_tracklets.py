"""Tracklets of tracks moved to absent markers, against the truth and against all markers."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts import absent_markers, moved_tracklets
from asterism.tracking.attempts.absent_markers import AbsentMarkers
from asterism.tracking.attempts.moved_tracklets import with_moved_tracklets
from asterism.tracking.attempts.posterior import log_posterior

CAPTURE = am.simulate.corrupt(
    am.simulate.person(activity="run", frames=300, seed=2),
    clutter=0.05, noise=3e-4, stride=2, seed=2,
)  # fmt: skip
D, FRAME = CAPTURE.detections, CAPTURE.detections.frame_of
MODEL = am.tracking.tracklet_model(am.estimate_model(D).model)
SHARED = am.tracking.learn_shared_acceleration(CAPTURE, MODEL)
GAP = MODEL.population.max_gap + 2
ONE, OTHER, FAR = 36, 37, 4
"""Two markers of one segment, and one of another."""


def at(labels, marker, begin, end):
    return (labels == marker) & (begin <= FRAME) & (end > FRAME)


def occluded(*hidden):
    """The truth with detections of some markers as clutter; each is (marker, begin, end)."""
    labels = CAPTURE.labels.copy()
    for marker, begin, end in hidden:
        labels[at(labels, marker, begin, end)] = -1
    return labels


def moved(labels, model=MODEL):
    return with_moved_tracklets(am.Tracks(detections=D, labels=labels), model, SHARED)


def alone(begin, end):
    """ONE, with a tracklet between long gaps, and OTHER, which is absent in all of that."""
    return occluded(
        (ONE, begin - GAP, begin), (ONE, end, end + GAP), (OTHER, begin - GAP, end + GAP)
    )


@pytest.mark.parametrize(("begin", "end"), [(60, 64), (60, 80), (40, 100)])
def test_a_tracklet_with_another_label_moves_to_its_marker_and_stays_there(begin, end):
    right = alone(begin, end)
    wrong = right.copy()
    wrong[at(right, ONE, begin, end)] = OTHER
    np.testing.assert_array_equal(moved(wrong), right)
    np.testing.assert_array_equal(moved(right), right)


@pytest.mark.parametrize("is_beginning", [True, False])
def test_the_beginning_or_the_end_of_a_piece_moves_to_its_marker(is_beginning):
    begin, end, far = 60, 65, 65 + GAP
    if is_beginning:  # OTHER is seen again one frame after the tracklet of ONE
        hidden = [(ONE, begin - GAP, begin), (ONE, end, far)]
        hidden += [(OTHER, begin - GAP, end + 1), (OTHER, end + 8, end + 9)]
    else:  # OTHER is last seen two frames before it
        hidden = [(ONE, begin - GAP, begin), (ONE, end, far)]
        hidden += [(OTHER, begin - 8, begin - 7), (OTHER, begin - 1, far)]
    right = occluded(*hidden)
    wrong = right.copy()
    wrong[at(right, ONE, begin, end)] = OTHER
    np.testing.assert_array_equal(moved(wrong), right)


def test_the_most_probable_move_is_made_first_and_changes_the_others(monkeypatch):
    before = {0: 40.0, 1: 50.0, 2: 60.0, 3: 14.0, 4: 45.0, 5: 17.0}
    after = before | {0: 20.0, 1: -np.inf, 4: 18.0, 5: 14.5}
    moves = []

    class Markers:
        def __init__(self, _, labels, *others):
            self.labels = labels

        def best(self, tracklet):
            n = int(tracklet[0])
            return (after if moves else before)[n], n

        def move(self, _, marker):
            moves.append(marker)

    monkeypatch.setattr(moved_tracklets, "AbsentMarkers", Markers)
    monkeypatch.setattr(moved_tracklets, "_tracklets", lambda *_: [np.array([n]) for n in range(6)])
    moved(CAPTURE.labels)
    assert moves == [2, 0, 4]


def test_a_tracklet_of_which_a_part_has_moved_stays():
    third = OTHER + 1  # absent as well, so that the whole tracklet could be of it
    labels = alone(60, 64)
    labels[at(labels, third, 50, 80)] = -1
    tracklet = np.flatnonzero(at(labels, ONE, 60, 64))
    markers = AbsentMarkers(am.Tracks(detections=D, labels=labels), labels, MODEL, SHARED)
    assert markers.best(tracklet)[1] in (OTHER, third)
    markers.move(tracklet[:2], OTHER)
    assert markers.best(tracklet[:2])[1] == third or markers.best(tracklet[2:])[1] == third
    assert markers.best(tracklet) == (-np.inf, -1)


def test_a_tracklet_is_not_its_own_neighbour():
    neighbour = int(SHARED.others[SHARED.offsets[ONE]])
    clutter = occluded((ONE, 50, 80), (neighbour, 50, 80))
    other, tracklet = clutter.copy(), np.flatnonzero(at(CAPTURE.labels, ONE, 60, 64))
    other[tracklet] = neighbour
    deviations = [
        AbsentMarkers(
            am.Tracks(detections=D, labels=each), each, MODEL, SHARED
        )._deviation(ONE, tracklet)
        for each in (clutter, other)
    ]  # fmt: skip
    assert deviations[0] == deviations[1]


def test_many_wrong_tracklets_are_mended_and_no_right_one_is_lost():
    rng, labels = np.random.default_rng(3), CAPTURE.labels.copy()
    wrong, n = labels.copy(), 0
    for begin in range(GAP + 1, D.n_frames - 3 * GAP, 3 * GAP):
        one, other = rng.choice(CAPTURE.n_tracks, 2, replace=False)
        end = begin + int(rng.integers(4, 8))
        for marker, first, last in ((one, begin - GAP, begin), (one, end, end + GAP)):
            hidden = at(labels, marker, first, last)
            labels[hidden] = wrong[hidden] = -1
        hidden = at(labels, other, begin - GAP, end + GAP)
        labels[hidden] = wrong[hidden] = -1
        wrong[at(labels, one, begin, end)] = other
        n += 1
    found = moved(wrong)
    assert (wrong != labels).sum() > 30
    assert n > 5
    assert (found != labels).sum() < 0.3 * (wrong != labels).sum()
    assert (found == labels)[wrong == labels].all()


def test_only_short_tracklets_move_and_only_by_enough(monkeypatch):
    right = alone(60, 80)
    wrong = right.copy()
    wrong[at(right, ONE, 60, 80)] = OTHER
    monkeypatch.setattr(moved_tracklets, "MAX_LENGTH", 19)
    np.testing.assert_array_equal(moved(wrong), wrong)
    monkeypatch.setattr(moved_tracklets, "MAX_LENGTH", 20)
    tracks = am.Tracks(detections=D, labels=wrong)
    tracklet = np.flatnonzero(at(right, ONE, 60, 80))
    log_odds, _ = AbsentMarkers(tracks, wrong, MODEL, SHARED).best(tracklet)
    for least, after in ((log_odds + 1e-6, wrong), (log_odds - 1e-6, right)):
        monkeypatch.setattr(moved_tracklets, "MIN_LOG_ODDS", least)
        np.testing.assert_array_equal(moved(wrong), after)


def test_the_best_marker_is_the_most_probable_of_all_that_are_absent(monkeypatch):
    monkeypatch.setattr(absent_markers, "MAX_DEVIATION", np.inf)
    others = range(OTHER, OTHER + 6)
    labels = occluded(*[(k, 50, 80) for k in others])
    tracks = am.Tracks(detections=D, labels=labels)
    tracklet = np.flatnonzero(at(CAPTURE.labels, OTHER + 2, 60, 64))
    log_odds, marker = AbsentMarkers(tracks, labels, MODEL, SHARED).best(tracklet)

    def whole(k):
        changed = labels.copy()
        changed[tracklet] = k
        return log_posterior(am.Tracks(detections=D, labels=changed), MODEL, SHARED)

    each = {k: whole(k) - whole(-1) for k in others}
    assert marker == max(each, key=each.get)
    assert log_odds == pytest.approx(each[marker], abs=1e-3)


@pytest.mark.parametrize("marker", [0, FAR, ONE])  # 0 is before all of its neighbours
def test_detections_are_of_a_marker_only_where_its_distances_lead(marker):
    labels = occluded((marker, 50, 80))
    tracks = am.Tracks(detections=D, labels=labels)
    markers = AbsentMarkers(tracks, labels, MODEL, SHARED)
    log_odds, best = markers.best(np.flatnonzero(at(CAPTURE.labels, marker, 60, 64)))
    assert best == marker
    assert log_odds > 0
    far = np.flatnonzero(at(CAPTURE.labels, 20, 60, 64))
    assert markers.best(far) == (-np.inf, -1)


def test_distances_are_those_of_the_whole_tracklet():
    labels = occluded((ONE, 50, 80))
    tracks = am.Tracks(detections=D, labels=labels)
    own = np.flatnonzero(at(CAPTURE.labels, ONE, 59, 60))
    longer = np.flatnonzero(at(CAPTURE.labels, 20, 60, 80))
    labels[longer] = -1
    markers = AbsentMarkers(tracks, labels, MODEL, SHARED)
    assert markers.best(own)[1] == ONE
    assert markers.best(np.append(own, longer))[1] != ONE


def test_a_move_makes_the_marker_present_and_the_old_one_absent():
    labels = alone(60, 64)
    tracklet, third = (np.flatnonzero(at(labels, k, 60, 64)) for k in (ONE, OTHER + 1))
    markers = AbsentMarkers(am.Tracks(detections=D, labels=labels), labels, MODEL, SHARED)
    assert [markers.best(each)[1] for each in (tracklet, third)] == [OTHER, OTHER]
    markers.move(tracklet, OTHER)
    assert (markers.labels[tracklet] == OTHER).all()
    assert [markers.best(each)[1] for each in (tracklet, third)] == [ONE, ONE]
    assert (labels[tracklet] == ONE).all()
