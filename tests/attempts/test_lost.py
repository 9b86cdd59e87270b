"""Markers that their tracks have lost, found by their distances to others in the frame."""

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.tracking.attempts.lost import with_lost_markers
from tests.references.lost_markers import found_in_frame

NOISE = 2e-4


@pytest.fixture(scope="module")
def person():
    made = am.simulate.person(activity="run", frames=300, seed=3)
    return am.simulate.corrupt(made, missing=0.1, clutter=0.2, noise=NOISE, seed=3)


def without(truth, is_lost):
    return am.Tracks(
        detections=truth.detections, labels=np.where(is_lost, -1, truth.labels), names=truth.names
    )


def test_segments_that_were_lost_for_some_frames_are_found(person):
    lost = ("RELB", "RFRM", "RWRA", "RWRB", "RFIN")
    arm = [person.names.index(name) for name in lost]
    is_lost = np.isin(person.labels, arm) & (person.detections.frame_of % 50 < 5)
    tracks = without(person, is_lost)
    found = with_lost_markers(tracks.detections, tracks.labels, NOISE)
    changed = found != tracks.labels
    assert is_lost.sum() > 100
    assert (found[changed] == person.labels[changed]).mean() > 0.98
    assert (found[is_lost] == person.labels[is_lost]).mean() > 0.8


def test_a_track_with_a_detection_in_the_frame_takes_no_other(person):
    found = with_lost_markers(person.detections, person.labels, NOISE)
    kept = person.labels >= 0
    assert (found[kept] == person.labels[kept]).all()
    am.Tracks(detections=person.detections, labels=found)  # at most one in a frame
    assert (found[~kept] >= 0).mean() < 0.02


def test_independent_markers_are_not_found():
    swarm = am.simulate.smooth(n_markers=20, frames=200, seed=2)
    tracks = without(swarm, (swarm.labels == 3) & (swarm.detections.frame_of > 150))
    assert (with_lost_markers(tracks.detections, tracks.labels, NOISE) == tracks.labels).all()


def test_nothing_is_found_without_tracks_or_detections():
    empty = am.Detections.from_frames([0.0, 0.01], [np.empty((0, 3)), np.empty((0, 3))])
    tracks = am.Tracks(detections=empty, labels=np.empty(0, dtype=int))
    assert not len(with_lost_markers(tracks.detections, tracks.labels, NOISE))
    alone = am.Detections.from_frames([0.0], [np.zeros((1, 3))])
    clutter = am.Tracks(detections=alone, labels=np.array([-1]))
    assert with_lost_markers(clutter.detections, clutter.labels, NOISE).tolist() == [-1]


def test_the_engine_finds_what_the_reference_finds():
    """Bodies of random markers with random bonds, some lost, among clutter, ghosts and twins."""
    rng = np.random.default_rng(5)
    n_found = 0
    for _ in range(400):
        n = int(rng.integers(3, 13))
        body = rng.uniform(-0.3, 0.3, (n, 3))
        if rng.random() < 0.5:  # two tracks of nearly the same distances
            body[1] = body[0] + rng.normal(0, 0.003, 3)
        distances = np.linalg.norm(body[:, None] - body, axis=2)
        distances += np.triu(rng.normal(0, 0.003, (n, n)), 1)
        spreads = rng.uniform(0.002, 0.02, (n, n))
        spreads[rng.random((n, n)) < 0.2] = np.inf
        np.fill_diagonal(spreads, np.inf)
        seen = np.flatnonzero(rng.random(n) < 0.9)
        near = body[rng.choice(n, 2)] + rng.normal(0, 0.01, (2, 3))
        clutter = rng.uniform(-0.5, 0.5, (3, 3))
        points = np.concatenate([body[seen] + rng.normal(0, 0.003, (len(seen), 3)), near, clutter])
        labels = np.concatenate([np.where(rng.random(len(seen)) < 0.5, seen, -1), np.full(5, -1)])
        order = rng.permutation(len(points))
        points, labels = points[order], labels[order]
        expected = found_in_frame(points, labels, distances, spreads)
        offsets = np.array([0, len(points)])
        found = _engine.find_lost(points, labels, offsets, distances, spreads)
        np.testing.assert_array_equal(found, expected)
        n_found += int((found != labels).sum())
    assert n_found > 400
