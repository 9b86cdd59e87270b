"""Searches from tracks whose markers accelerate together."""

from __future__ import annotations

import numpy as np

import asterism as am
from asterism.tracking.attempts.shared_search import (
    labels_of_markers,
    searched_with_shared_accelerations,
)


def test_tracklets_have_the_label_that_most_of_their_detections_had():
    frame = np.array([0, 0, 1, 1, 2, 2, 3, 3, 4])
    given = np.array([0, 1, 0, 1, 1, 0, 0, -1, -1])
    found = np.array([0, 1, 0, 1, 0, 1, 0, 1, 2])
    # The third detection of each is the other's; a detection without a label joins its tracklet.
    expected = [0, 1, 0, 1, 0, 1, 0, 1, -1]
    assert labels_of_markers(found, given, frame).tolist() == expected


def test_the_shorter_of_two_tracklets_in_a_frame_is_clutter():
    frame = np.array([0, 1, 1, 2, 3, 3, 4])
    given = np.array([3, 3, -1, 3, 3, -1, 3])
    found = np.array([0, 0, 1, 1, 2, 0, 2])
    # Track 0 is in frames 0, 1, 3, track 1 in 1 and 2, and track 2 in 3 and 4.
    assert labels_of_markers(found, given, frame).tolist() == [3, 3, -1, -1, -1, 3, -1]


def test_no_tracks_are_found_in_none():
    none = np.full(3, -1)
    assert labels_of_markers(none, none, np.arange(3)).tolist() == [-1, -1, -1]


def test_a_search_takes_detections_back_that_tracks_have_lost():
    truth = am.simulate.corrupt(
        am.simulate.person(activity="run", frames=300, seed=1), noise=3e-4, stride=2, seed=1
    )
    d, labels = truth.detections, truth.labels.copy()
    rng = np.random.default_rng(1)
    labels[rng.random(len(labels)) < 0.05] = -1
    model = am.tracking.tracklet_model(am.estimate_model(d).model)
    start = am.Tracks(detections=d, labels=labels)
    found = [
        searched_with_shared_accelerations(start, model, seed=1, threads=threads)
        for threads in (1, 2)
    ]
    np.testing.assert_array_equal(*found)
    is_lost = labels < 0
    is_taken = is_lost & (found[0] >= 0)
    assert is_taken.sum() > 0.4 * is_lost.sum()
    assert (found[0] == truth.labels)[is_taken].all()
    assert (found[0] == truth.labels)[~is_lost].mean() > 0.998
