"""Segments whose markers are lost together."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.correction.segments import with_lost_segments


def lost(truth, first, last):
    """Return tracks without a detection from one frame to another, and those detections."""
    frame = truth.detections.frame_of
    own = (frame >= first) & (frame <= last)
    labels = np.where(own, -1, truth.labels)
    return am.Tracks(detections=truth.detections, labels=labels, names=truth.names), own


@pytest.fixture(scope="module")
def walk():
    return am.simulate.person(activity="walk", frames=200, seed=3)


@pytest.fixture(scope="module")
def placed(walk):
    """Labels of the walk where all markers are lost for a while, and which were found."""
    return with_lost_segments(*lost(walk, 80, 95))


def test_markers_of_a_segment_are_found_without_any_known_marker_beside_them(walk, placed):
    truth, (found, is_placed) = walk, placed
    _, own = lost(truth, 80, 95)
    assert (found[~own] == truth.labels[~own]).all()
    assert is_placed.sum() > 0.1 * own.sum()
    assert (found[is_placed] == truth.labels[is_placed]).all()
    assert (found[own & ~is_placed] == -1).all()


def test_detections_that_are_not_open_stay(walk):
    tracks, own = lost(walk, 80, 95)
    found, is_placed = with_lost_segments(tracks, np.zeros(len(own), dtype=bool))
    assert not is_placed.any()
    assert (found == tracks.labels).all()


def test_markers_whose_distances_are_alike_are_left_without_a_track():
    truth = am.simulate.cube(frames=200, seed=1)
    tracks, own = lost(truth, 80, 95)
    found, is_placed = with_lost_segments(tracks, own)
    assert not is_placed.any()
    assert (found == tracks.labels).all()


def test_wrong_detections_of_lost_markers_give_way(walk, placed):
    truth, (_, is_placed) = walk, placed
    tracks, own = lost(truth, 80, 95)
    frame = truth.detections.frame_of
    of_frame = np.flatnonzero(is_placed & (frame == 90))
    labels = tracks.labels.copy()
    labels[of_frame] = np.roll(truth.labels[of_frame], 1)  # in a circle
    exchanged = am.Tracks(detections=truth.detections, labels=labels, names=truth.names)
    found, _ = with_lost_segments(exchanged, own)
    assert (found[of_frame] == truth.labels[of_frame]).all()
