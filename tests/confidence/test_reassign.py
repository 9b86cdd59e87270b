"""Assignment of uncertain detections by the distances that tracks keep."""

from __future__ import annotations

import numpy as np

import asterism as am
from asterism import _engine
from asterism.tracking.confidence.reassign import EVEN_ODDS, gains, ghost_log_odds, reassigned
from tests.references.reassignment import Reassignment
from tests.scenes import moving, sized

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


def test_two_tracks_that_are_exchanged_over_runs_of_frames_return():
    truth, _ = body()
    labels = truth.labels.reshape(200, 8).copy()
    for run in (slice(30, 31), slice(50, 53), slice(120, 160)):
        labels[run, 1:3] = [2, 1]
    tracks = am.Tracks(detections=truth.detections, labels=labels.ravel())
    found = again(tracks, np.ones(labels.size, dtype=bool))
    np.testing.assert_array_equal(found, truth.labels)


def test_at_even_odds_what_is_more_probable_than_not_is_taken():
    truth, tracks = body()
    is_open, ghost = tracks.labels != truth.labels, np.where(tracks.labels < 0, 2.0, 0.0)
    noisy = 100 * NOISE  # distances that tell little
    strict = reassigned(tracks, is_open, ghost, noisy)
    found = reassigned(tracks, is_open, ghost, noisy, EVEN_ODDS)
    lost = tracks.labels < 0
    assert (strict[lost] < 0).all()
    np.testing.assert_array_equal(found[lost], truth.labels[lost])


def test_right_changes_gain_and_wrong_ones_lose():
    truth, tracks = body()
    ghost = np.zeros(len(tracks.labels))
    found = gains(tracks, truth.labels, ghost, NOISE)
    is_changed = tracks.labels != truth.labels
    assert (found[is_changed] > 0).all()
    assert not found[~is_changed].any()
    back = gains(truth, tracks.labels, ghost, NOISE)
    assert back[is_changed].sum() < 0


def exchanged_at_random(rng, n=5, frames=9):
    """A near-rigid body with missing detections and clutter, and exchanges over runs of frames."""
    shape = rng.uniform(-0.15, 0.15, (n, 3))
    t, positions = moving(shape, frames, int(rng.integers(99)), noise=0.003)
    body = am.Tracks.from_dense(t, positions, tuple(map(str, range(n))))
    labels = np.arange(n) * np.ones((frames, 1), dtype=int)
    for _ in range(4):
        begin, length = int(rng.integers(frames)), int(rng.integers(1, 6))
        pair = rng.permutation(n)[:2]
        labels[begin : begin + length, pair] = labels[begin : begin + length, pair[::-1]]
    labels[rng.random(labels.shape) < 0.15] = -1
    is_kept = (rng.random(labels.shape) > 0.1).ravel()
    points, frame = body.detections.points[is_kept], body.detections.frame_of[is_kept]
    return np.ascontiguousarray(points), frame.astype(np.int64), labels.ravel()[is_kept]


def held_to_reference(seed):
    """Return the number of changed labels, which are those of the reference implementation.

    The support of each detection in its track is that of the reference implementation too.
    """
    rng = np.random.default_rng([seed, 31])
    points, frame, labels = exchanged_at_random(rng)
    n_tracks, n_frames = labels.max() + 1, frame.max() + 1
    is_open, ghost = rng.random(len(labels)) < 0.9, rng.normal(0, 2, len(labels))
    sigma = rng.uniform(0.002, 0.02, n_tracks)
    offsets = np.searchsorted(frame, np.arange(n_frames + 1)).astype(np.int64)
    engine = _engine.DistanceProfiles(
        points, labels, offsets, np.arange(n_frames), n_tracks=n_tracks, noise=0.003
    )
    found = engine.assigned(
        points, labels, offsets, is_open, ghost, sigma, log_clutter=-2.0, change=0.7, max_gap=3
    )
    reference = Reassignment(points, frame, labels, is_open, ghost, sigma, 0.003, -2.0, 0.7, 3)
    supports = engine.supports(
        points, labels, offsets, is_open, ghost, sigma, log_clutter=-2.0, max_gap=3
    )
    expected = [reference.support(i) if is_open[i] else 0 for i in range(len(labels))]
    np.testing.assert_allclose(supports, expected, atol=1e-9)
    np.testing.assert_array_equal(found, reference.assigned())
    return int((found != labels).sum())


def test_labels_are_those_of_the_reference():
    n = sized(30, 3)
    assert sum(held_to_reference(seed) for seed in range(n)) > 3 * n
