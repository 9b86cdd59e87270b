"""Names in streams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError
from asterism.tracking import Method, Named, Update


@dataclass(frozen=True)
class Replayed:
    """State of `Replay`."""

    frame: int = 0
    n_seen: int = 0
    info: tuple = ()


class Replay(Method[Replayed]):
    """Method that gives the labels of tracks, frame by frame."""

    name = "replay"

    def __init__(self, tracks):
        self.tracks = tracks

    def init(self, model, *, n_axes=3, seed=None):
        return Replayed(info={})

    def step(self, state, time, points, *, covariances=None):
        d = self.tracks.detections
        labels = self.tracks.labels[slice(*d.offsets[[state.frame, state.frame + 1]])]
        after = Replayed(state.frame + 1, state.n_seen + len(labels), info={})
        return after, Update(labels=labels)


def named(tracks, *sets):
    """For each frame the state, and the names given; tracks are those of a replay."""
    method = Named(marker_sets=sets, method=Replay(tracks))
    state = method.init(None)
    states, names = [], []
    for time, points in tracks.detections:
        state, update = method.step(state, time, points)
        states.append(state)
        names.append(update.names)
    return states, names


def share_right(names, truth, first):
    """Share of the detections from a frame on that have the right name."""
    d = truth.detections
    right = [
        given == truth.names[label]
        for t in range(first, d.n_frames)
        for given, label in zip(names[t], truth.labels[slice(*d.offsets[[t, t + 1]])], strict=True)
        if label >= 0
    ]
    return np.mean(right)


@pytest.fixture(scope="module")
def person():
    return am.simulate.person(frames=400, seed=4)


@pytest.fixture(scope="module")
def made():
    return am.learn_marker_set(am.simulate.person(frames=200, seed=4))


@pytest.mark.parametrize("start", [0, 57, 140])
def test_names_come_within_a_second_from_any_frame(person, made, start):
    truth = person.part(start, start + 200)
    states, names = named(truth, made)
    assert not any(states[20].names)
    assert share_right(names, truth, 60) == 1
    assert min(states[-1].probabilities.values()) > 0.5
    assert states[-1].info["named"] == truth.n_tracks


def test_a_marker_that_comes_back_as_a_new_track_has_its_name_again(person, made):
    k = person.names.index("RKNE")
    d = person.detections
    labels = person.labels.copy()
    gone = (labels == k) & (d.frame_of >= 100) & (d.frame_of < 160)
    labels[(labels == k) & (d.frame_of >= 160)] = person.n_tracks
    labels[gone] = -1
    states, names = named(am.Tracks(detections=d, labels=labels), made)
    assert states[120].names[k] == "RKNE"  # still the name of the occluded track
    assert states[180].names[person.n_tracks] == "RKNE"
    assert k not in states[180].names
    rows = slice(*d.offsets[[300, 301]])
    assert names[300][int(np.flatnonzero(labels[rows] == person.n_tracks)[0])] == "RKNE"


def test_tracks_that_exchange_their_markers_exchange_their_names(person, made):
    one, other = (person.names.index(name) for name in ("RTHI", "RKNE"))
    d = person.detections
    labels = person.labels.copy()
    late = d.frame_of >= 150
    labels[late & (person.labels == one)] = other
    labels[late & (person.labels == other)] = one
    wrong = am.Tracks(detections=d, labels=labels)
    states, names = named(wrong, made)
    assert states[149].names[one] == "RTHI"
    assert states[-1].names[one] == "RKNE"
    assert states[-1].names[other] == "RTHI"
    assert share_right(names, person, 350) == 1


def test_a_ghost_has_no_name(person, made):
    at = person.positions()
    ghost = at[:, :1] + [0, 0, 0.3] + np.random.default_rng(1).normal(0, 0.02, (len(at), 1, 3))
    tracks = am.Tracks.from_dense(person.detections.times, np.concatenate([at, ghost], axis=1))
    states, _ = named(tracks, made)
    assert len(states[-1].names) == person.n_tracks
    assert person.n_tracks not in states[-1].names


def test_a_set_of_another_body_gives_no_name(person):
    other = am.learn_marker_set(am.simulate.fingers(seed=2))
    states, names = named(person.part(0, 150), other)
    assert not any(state.names for state in states)
    assert not any(any(frame) for frame in names)


def test_every_subject_is_named_by_its_own_set():
    truth = am.simulate.two_people(frames=150, seed=3)
    d = truth.detections
    sets = []
    for subject in sorted({name.split(":")[0] for name in truth.names}):
        own = truth.select([n for n in truth.names if n.startswith(subject + ":")])
        short = [n.split(":")[1] for n in own.names]
        sets.append(
            am.learn_marker_set(
                am.Tracks(detections=own.detections, labels=own.labels, names=tuple(short))
            ).of_subject(subject)
        )
    _, names = named(truth, *sets)
    is_named = [n is not None for n in names[-1]]
    own = truth.labels[d.offsets[-2] :]
    wrong = [n for n, m in zip(names[-1], own, strict=True) if n and n != truth.names[m]]
    assert not wrong
    assert np.mean(is_named) > 0.9


def test_states_are_values(person, made):
    method = Named(marker_sets=made, method=am.GNN())
    state = method.init(am.estimate_model(person.detections).model)
    kept = None
    for t, (time, points) in enumerate(person.detections):
        if t == 150:
            kept = state
        state, update = method.step(state, time, points)
        if t == 150:
            first = update
    _, again = method.step(kept, *list(person.detections)[150])
    assert again.names == first.names
    assert np.array_equal(again.labels, first.labels)


@pytest.mark.parametrize("wrong", [(), ("set",)])
def test_sets_that_are_none_are_refused(wrong):
    with pytest.raises(ParameterError, match="marker_sets: expected"):
        Named(marker_sets=wrong, method=am.GNN())


def test_after_a_pause_in_which_all_tracks_end_the_names_are_searched_again():
    truth = am.simulate.fingers(frames=240, seed=1)
    d = truth.detections
    method = am.tracking.Named(marker_sets=am.learn_marker_set(truth), method=am.GNN())
    model = am.estimate_model(d).model
    state = method.init(model)
    for time, points in d.part(0, 100):
        state, update = method.step(state, time, points)
    before = set(update.names)
    assert len(before - {None}) > 20
    end = float(d.times[99])
    for k in range(1, model.population.max_gap + 2):
        state, update = method.step(state, end + k * d.step, np.empty((0, 3)))
    assert len(update.tracks) == 0
    later = end + (model.population.max_gap + 2) * d.step
    for time, points in d.part(100, 240):
        state, update = method.step(state, later + time - float(d.times[100]), points)
    assert set(update.names) == before
