"""Assignment of uncertain detections by the distances that tracks keep."""

from __future__ import annotations

import numpy as np

import asterism as am
from asterism.tracking.confidence.reassign import ghost_log_odds, reassigned
from tests.scenes import moving

NOISE = 3e-4
MIXED = slice(80, 100)


def body(n=8, frames=200):
    """A rigid body; the labels of three near markers go round in some frames, and one is lost."""
    shape = np.random.default_rng(3).uniform(-0.3, 0.3, (n, 3))
    shape[1:3] = shape[0] + [[0.05, 0, 0], [0, 0.05, 0]]
    t, positions = moving(shape, frames, seed=5, noise=NOISE)
    truth = am.Tracks.from_dense(t, positions, tuple(map(str, range(n))))
    labels = truth.labels.reshape(frames, n).copy()
    labels[MIXED, :3] = [1, 2, 0]
    labels[MIXED, 4] = -1
    return truth, am.Tracks(detections=truth.detections, labels=labels.ravel())


def again(tracks, is_open):
    return reassigned(tracks, is_open, ghost_log_odds(tracks, None), NOISE)


def test_markers_that_went_round_and_a_lost_one_return():
    truth, tracks = body()
    is_open = tracks.labels != truth.labels
    assert is_open.sum() == 80
    np.testing.assert_array_equal(again(tracks, is_open), truth.labels)


def test_only_open_detections_change():
    truth, tracks = body()
    is_open = tracks.labels != truth.labels
    is_open[truth.detections.frame_of >= 90] = False
    found = again(tracks, is_open)
    np.testing.assert_array_equal(found[~is_open], tracks.labels[~is_open])
    np.testing.assert_array_equal(found[is_open], truth.labels[is_open])


def test_a_ghost_stays_one():
    truth, tracks = body()
    is_open = tracks.labels != truth.labels
    ghost = np.where(tracks.labels < 0, 20.0, 0.0)
    found = reassigned(tracks, is_open, ghost, NOISE)
    np.testing.assert_array_equal(found, np.where(tracks.labels < 0, -1, truth.labels))


def test_independent_markers_stay_where_they_are():
    truth = am.simulate.wander(frames=150, rate=100, seed=2)
    labels = truth.labels.copy()
    d = truth.detections
    labels[d.offsets[60] : d.offsets[70]] = -1
    tracks = am.Tracks(detections=d, labels=labels)
    is_open = np.ones(len(labels), dtype=bool)
    np.testing.assert_array_equal(again(tracks, is_open), labels)
