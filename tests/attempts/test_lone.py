"""Lone detections in gaps of one frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts.lone import with_lone_detections

CUBE = am.simulate.corrupt(am.simulate.cube(frames=60, seed=1), noise=3e-4, seed=1)
TRUTH = am.Tracks.from_dense(CUBE.detections.times, CUBE.positions())
"""The detections of a frame are in the order of the 8 markers."""
MODEL = am.estimate_model(TRUTH.detections).model
AT, N = 30, 8
FIRST = AT * N
"""Detection of the first marker in frame `AT`."""


def stitched(labels, points=TRUTH.detections.points):
    changed = dataclasses.replace(TRUTH.detections, points=points)
    return am.stitch(am.Tracks(detections=changed, labels=labels), MODEL)


def missed(*offsets):
    """Tracks in which the first marker misses a frame, with detections at offsets from it."""
    d, more = TRUTH.detections, len(offsets) - 1
    at = np.repeat(d.points[FIRST][None], len(offsets), axis=0) + offsets
    points = np.concatenate([d.points[:FIRST], at, d.points[FIRST + 1 :]])
    labels = np.concatenate([TRUTH.labels[:FIRST], [-1] * (more + 1), TRUTH.labels[FIRST + 1 :]])
    ends = d.offsets + more * (np.arange(len(d.offsets)) > AT)
    changed = am.Detections(times=d.times, offsets=ends, points=points)
    return am.stitch(am.Tracks(detections=changed, labels=labels), MODEL)


@pytest.mark.parametrize(
    ("offsets", "taken"),
    [
        ([[0, 0, 0]], [0]),
        ([[0, 0.01, 0]], [0]),  # a jolt
        ([[0, 0.3, 0]], []),  # far
        ([[0, 0.01, 0], [0, 0, 0.002]], [1]),  # the nearer of two
        ([[0, 0.002, 0], [0, 0.002, 0]], [0]),  # one of two at the same place
    ],
)
def test_the_nearest_detection_in_a_gap_of_one_frame_is_taken(offsets, taken):
    before = missed(*offsets)
    found = with_lone_detections(before, MODEL)
    expected = before.tracks.labels.copy()
    expected[FIRST + np.array(taken, dtype=int)] = expected[0]
    np.testing.assert_array_equal(found.tracks.labels, expected)
    np.testing.assert_array_equal(found.tracklets >= 0, expected >= 0)
    assert found.tracks.info["lone"] == len(taken)
    assert found.joins == before.joins == ()
    again = with_lone_detections(found, MODEL)
    np.testing.assert_array_equal(again.tracks.labels, expected)
    assert again.tracks.info["lone"] == len(taken)


def test_a_detection_between_two_gaps_is_taken_by_the_nearer_track():
    labels, points = TRUTH.labels.copy(), TRUTH.detections.points.copy()
    labels[FIRST : FIRST + 2] = -1
    points[FIRST] += 0.05 * (points[FIRST + 1] - points[FIRST])
    points[FIRST + 1] += 1
    found = with_lone_detections(stitched(labels, points), MODEL).tracks
    assert found.labels[FIRST : FIRST + 2].tolist() == [found.labels[0], -1]


def test_detections_of_ghosts_and_in_longer_gaps_are_not_taken():
    before = missed([0, 0, 0])
    tracklets = before.tracklets.copy()
    tracklets[FIRST] = tracklets.max() + 1
    ghost = dataclasses.replace(before, tracklets=tracklets)
    assert with_lone_detections(ghost, MODEL).tracks.info["lone"] == 0
    labels = TRUTH.labels.copy()
    labels[[FIRST, FIRST + N]] = -1
    assert with_lone_detections(stitched(labels), MODEL).tracks.info["lone"] == 0


def test_the_probability_is_the_confidence_of_the_detection():
    before = missed([0, 0.01, 0])
    confidence = np.where(before.tracks.labels >= 0, 1.0, 0.0)
    tracks = dataclasses.replace(before.tracks, confidence=confidence)
    found = with_lone_detections(dataclasses.replace(before, tracks=tracks), MODEL)
    assert 0.98 < found.tracks.confidence[FIRST] < 1


def test_only_certain_detections_are_taken():
    taken = []
    for off in np.linspace(0, 0.3, 31):
        before = missed([0, off, 0])
        tracks = dataclasses.replace(before.tracks, confidence=np.ones(len(TRUTH.labels)))
        found = with_lone_detections(dataclasses.replace(before, tracks=tracks), MODEL).tracks
        taken.append(found.labels[FIRST] >= 0)
        assert not taken[-1] or found.confidence[FIRST] > 0.98
    assert any(taken)
    assert not all(taken)


def test_the_default_takes_a_jolt_as_its_recipe_does():
    points = TRUTH.detections.points.copy()
    points[FIRST] += [0, 0.02, 0]
    jolt = dataclasses.replace(TRUTH.detections, points=points)
    alone = am.track(jolt, am.SMP(window=3), stitch=True)
    found = am.track(jolt)
    assert int((alone.labels < 0).sum()) == 1
    assert found.labels[FIRST] == found.labels[0] >= 0
    assert all(each.probability >= 0.95 for each in found.decisions)
    again = am.track(jolt, recipe=found.recipe)
    np.testing.assert_array_equal(again.labels, found.labels)
