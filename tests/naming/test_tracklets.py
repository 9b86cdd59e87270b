"""Tracklets joined, and exchanges undone, before anything is named."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from asterism.tracking.naming.exchanges import without_exchanges
from asterism.tracking.naming.joining import MAX_GAP, joined


def cut(tracks, length, gap=0):
    """Tracks cut into tracklets of some frames, with some frames missing between them."""
    d = tracks.detections
    piece = d.frame_of // length
    labels = piece * tracks.n_tracks + tracks.labels
    labels[(d.frame_of % length >= length - gap) | (tracks.labels < 0)] = -1
    kept, own = np.unique(labels[labels >= 0], return_inverse=True)
    labels[labels >= 0] = own
    assert len(kept) > tracks.n_tracks
    return am.Tracks(detections=d, labels=labels)


def is_pure(tracks, truth):
    """Whether each of the tracks holds one marker."""
    used = tracks.labels >= 0
    pairs = np.unique(np.stack([tracks.labels[used], truth.labels[used]]), axis=1)
    return pairs.shape[1] == tracks.n_tracks


@pytest.mark.parametrize("gap", [0, 2, MAX_GAP - 1])
def test_tracklets_that_continue_each_other_are_joined(gap):
    truth = am.simulate.person(seed=2)
    pieces = cut(truth, 25, gap)
    whole = joined(pieces)
    n_joins = pieces.n_tracks - truth.n_tracks
    assert is_pure(whole, truth)
    assert pieces.n_tracks - whole.n_tracks >= (1.0 if gap == 0 else 0.85) * n_joins


def test_tracklets_after_a_longer_gap_are_left():
    pieces = cut(am.simulate.person(seed=2), 25, MAX_GAP)
    assert np.array_equal(joined(pieces).labels, pieces.labels)


def test_two_ways_to_join_are_left():
    """Two markers 4 mm apart, both cut at the same time."""
    times = np.arange(40) / 100
    one = np.stack([times, 0 * times, 0 * times], axis=1)
    for apart, n_tracks in ((0.004, 4), (0.2, 2)):
        at = np.stack([one, one + np.array([0, apart, 0])], axis=1)
        assert joined(cut(am.Tracks.from_dense(times, at), 20, 3)).n_tracks == n_tracks


def test_detections_without_a_track_and_short_tracks_are_left():
    truth = am.simulate.person(seed=1)
    pieces = cut(truth, 4)
    assert np.array_equal(joined(pieces).labels, pieces.labels)
    nothing = am.Tracks(detections=truth.detections, labels=np.full(truth.detections.n_points, -1))
    assert joined(nothing).n_tracks == 0


def exchanged(tracks, one, other, first, last):
    """Tracks that have each other's marker in some frames."""
    d = tracks.detections
    inside = (d.frame_of >= first) & (d.frame_of < last)
    labels = tracks.labels.copy()
    labels[inside & (tracks.labels == one)] = other
    labels[inside & (tracks.labels == other)] = one
    return am.Tracks(detections=d, labels=labels)


@pytest.mark.parametrize(("first", "last"), [(0.4, 1.0), (0.0, 0.3), (0.35, 0.6)])
@pytest.mark.parametrize("seed", range(3))
def test_an_exchange_is_undone(seed, first, last):
    truth = am.simulate.person(seed=seed)
    at = truth.positions()
    distance = np.linalg.norm(at[:, :, None] - at[:, None], axis=3).mean(axis=0)
    near = np.argwhere(np.triu((distance > 0.1) & (distance < 0.3)))
    n = truth.detections.n_frames
    for one, other in near[:: len(near) // 4]:
        wrong = exchanged(truth, one, other, int(first * n), int(last * n))
        assert is_pure(without_exchanges(wrong), truth)


def test_short_exchanges_in_a_long_capture_are_undone():
    truth = am.simulate.person(frames=2000, seed=1)
    one, other = (truth.names.index(name) for name in ("RTHI", "RKNE"))
    for stretches in ([(900, 1000)], [(550, 1300)], [(300, 400), (1500, 1700)], [(1900, 2000)]):
        wrong = truth
        for first, last in stretches:
            wrong = exchanged(wrong, one, other, first, last)
        right = without_exchanges(wrong)
        assert is_pure(right, truth)


@pytest.mark.parametrize("seed", range(4))
def test_tracks_of_one_marker_each_are_left(seed):
    for truth in (
        am.simulate.person(seed=seed),
        am.simulate.two_people(seed=seed),
        am.simulate.fingers(seed=seed),
        am.simulate.dense(n_markers=20, frames=80, seed=seed),
    ):
        assert without_exchanges(truth) is truth
