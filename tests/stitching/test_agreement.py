"""Tracks of one marker that are joined because both keep the same distances."""

import numpy as np
import pytest

import asterism as am
from asterism.tracking.stitching.agreement import agreeing

NOISE = 2e-4


@pytest.fixture(scope="module")
def person():
    return am.simulate.person(frames=300, seed=3)


def parted(truth, marker, frames):
    """Give the detections of a marker to a new track in some frames."""
    labels = truth.labels.copy()
    frame = truth.detections.frame_of
    labels[(labels == marker) & np.isin(frame, frames)] = truth.n_tracks
    return am.Tracks(detections=truth.detections, labels=labels)


@pytest.mark.parametrize("first", [150, 60])
def test_a_marker_in_two_tracks_is_found(person, first):
    tracks = parted(person, 7, range(first, 300))
    assert agreeing(tracks, NOISE) == [(7, person.n_tracks)]


@pytest.mark.parametrize(
    "turns", [[145, 147, *range(150, 300)], range(100, 200), range(100, 300, 2)]
)
def test_both_tracks_may_take_turns(person, turns):
    assert agreeing(parted(person, 7, turns), NOISE) == [(7, person.n_tracks)]


def test_tracks_with_a_common_frame_are_of_two_markers(person):
    """The same marker in two tracks, and a second point beside it in one frame."""
    tracks = parted(person, 7, range(150, 300))
    d, frame = tracks.detections, tracks.detections.frame_of
    (row,) = np.flatnonzero((tracks.labels == 7) & (frame == 100))
    points = [d.frame(t) for t in range(d.n_frames)]
    points[100] = np.concatenate([points[100], d.points[[row]] + 0.001])
    labels = np.insert(tracks.labels, d.offsets[101], person.n_tracks)
    both = am.Tracks(detections=am.Detections.from_frames(d.times, points), labels=labels)
    assert agreeing(both, NOISE) == []


def test_two_tracks_of_one_time_continue_no_third_one(person):
    """A marker is in another track for a while, and a copy of it begins where that ends."""
    tracks = parted(person, 7, range(100, 200))
    d, n = tracks.detections, person.n_tracks
    rows = np.flatnonzero((tracks.labels == 7) & (d.frame_of >= 200))
    noise = np.random.default_rng(1).normal(0, NOISE, (len(rows), 3))
    points = np.insert(d.points, rows, d.points[rows] + noise, axis=0)
    frame_of = np.insert(d.frame_of, rows, d.frame_of[rows])
    labels = np.insert(tracks.labels, rows, n + 1)
    frames = [points[frame_of == t] for t in range(d.n_frames)]
    both = am.Tracks(detections=am.Detections.from_frames(d.times, frames), labels=labels)
    found = agreeing(both, NOISE)
    assert found in ([(7, n)], [(n, n + 1)])


def test_tracks_of_two_markers_stay_apart(person):
    """One marker ends and another one begins, at other distances to all others."""
    d, labels = person.detections, person.labels
    kept = ~((labels == 7) & (d.frame_of >= 150)) & ~((labels == 20) & (d.frame_of < 150))
    tracks = am.Tracks(detections=d.keep(kept), labels=labels[kept])
    assert agreeing(tracks, NOISE) == []


def test_independent_markers_are_never_joined():
    swarm = am.simulate.smooth(n_markers=20, frames=200, seed=2)
    assert agreeing(parted(swarm, 3, range(100, 200)), NOISE) == []


def test_every_tracklet_of_a_stitching_continues_at_most_one_other(person):
    burst = am.simulate.Burst(n=2, shortest=10, longest=20)
    truth = am.simulate.corrupt(person, burst=burst, seed=1)
    model = am.tracking.tracklet_model(am.estimate_model(truth.detections).model)
    tracklets = am.track(truth.detections, am.GNN(), model=model)
    found = am.stitch(tracklets, model)
    own = np.flatnonzero(found.markers >= 0)
    after = found.after[own]
    assert (found.markers[after[after >= 0]] == found.markers[own[after >= 0]]).all()
    assert len(np.unique(after[after >= 0])) == (after >= 0).sum()  # each continues at most once


def test_no_pair_without_tracks(person):
    nothing = am.Tracks(
        detections=person.detections, labels=np.full(person.detections.n_points, -1)
    )
    assert agreeing(nothing, NOISE) == []
