"""The search for exchanges against all pairs, and the probabilities of links."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.tracking.confidence import links
from asterism.tracking.confidence.links import find_exchanges
from tests.references.exchanges import MIN_GAIN, every_exchange
from tests.scenes import crowd, interacting, sized, small_model, wanderers

TOLERANCE = 1e-9


def broken(truth, rng, share=0.5):
    """Give half of the markers tracklets that end and begin in the middle, and exchange some."""
    labels, frame = truth.labels.copy(), truth.detections.frame_of
    n = truth.n_tracks
    for k in np.flatnonzero(rng.random(n) < share):
        cut, gap = rng.integers(truth.detections.n_frames), rng.integers(12)
        labels[(truth.labels == k) & (frame >= cut)] = n + k
        labels[(truth.labels == k) & (frame >= cut - gap) & (frame < cut)] = -1
    cut, (a, b) = rng.integers(truth.detections.n_frames), rng.choice(n, 2, replace=False)
    later = frame >= cut
    was_a, was_b = labels == a, labels == b
    labels[was_a & later], labels[was_b & later] = b, a
    return labels


def keys_of(found, detections, labels):
    """Return the frame and the tracks of each exchange."""
    frame = np.append(detections.frame_of, detections.n_frames)  # the last is of no detection
    pairs = np.sort(found.tracks(labels), axis=1)
    return list(zip(frame[found.after].min(axis=1).tolist(), *pairs.T.tolist(), strict=True))


def held_to_reference(detections, labels, model, p_detection):
    """Return the number of exchanges, which are those of the reference implementation."""
    d = detections
    model = dataclasses.replace(
        model, sensor=dataclasses.replace(model.sensor, p_detection=p_detection)
    )
    found = find_exchanges(am.Tracks(detections=d, labels=labels), labels, model)
    own = [labels == k for k in range(labels.max(initial=-1) + 1)]
    tracks = [(d.frame_of[mask], d.points[mask]) for mask in own]
    wanted = every_exchange(model, d.times, tracks, p_detection)
    keys = keys_of(found, d, labels)
    assert len(set(keys)) == len(keys)  # none is counted twice
    for key, ratio, mutual in zip(keys, found.ratios, found.is_mutual, strict=True):
        assert ratio == pytest.approx(wanted[key].gain, rel=TOLERANCE, abs=TOLERANCE)
        assert mutual == wanted[key].is_mutual
        assert ratio >= MIN_GAIN
    lost = {
        key
        for key, one in wanted.items()
        if one.is_near and one.gain >= MIN_GAIN + TOLERANCE and key not in set(keys)
    }
    assert not lost
    return len(keys)


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
@pytest.mark.parametrize("irregular", [False, True])
def test_exchanges_are_those_of_all_pairs(n_axes, motion, irregular):
    n = 0
    for seed in range(sized(3, 1)):
        rng = np.random.default_rng([seed, n_axes])
        truth = wanderers(
            rng, n_axes=n_axes, n_frames=40, missing=0.2 + 0.2 * seed, irregular=irregular
        )
        model = small_model(**({} if motion == "dwna" else {"motion": interacting()}))
        n += held_to_reference(truth.detections, broken(truth, rng), model, 0.9)
    assert n >= 10


@pytest.mark.parametrize("n_axes", [2, 3])
def test_exchanges_in_a_crowd_are_those_of_all_pairs(n_axes):
    rng = np.random.default_rng(n_axes)
    truth = crowd(3, n_axes=n_axes)
    model = small_model(noise_sigma=0.01)
    assert held_to_reference(truth.detections, broken(truth, rng), model, 0.6) > 10


def test_sparse_tracks_far_apart_have_no_exchange():
    frames = [[[0.01 * t, 0, 0], [5.0, 0, 0]] if t % 3 == 0 else [] for t in range(30)]
    d = am.Detections.from_frames(0.1 * np.arange(30), frames)
    assert held_to_reference(d, np.tile([0, 1], 10), small_model(), 0.9) == 0


@pytest.mark.parametrize(
    "frames",
    [[], [[]], [[[0.0, 0, 0]]], [[[0.0, 0, 0]], [], [[0.1, 0, 0]]], [[[0.0, 0, 0], [0.01, 0, 0]]]],
)
def test_empty_and_single_input_has_no_exchange(frames):
    d = am.Detections.from_frames(
        0.1 * np.arange(len(frames)), [np.reshape(each, (-1, 3)) for each in frames]
    )
    labels = np.concatenate([np.arange(len(each)) for each in frames] or [[]]).astype(np.int64)
    for own in (labels, np.full_like(labels, -1)):
        assert held_to_reference(d, own, small_model(), 0.9) == 0


def test_the_exchange_of_two_crossing_tracks_is_found_as_probable():
    t = np.arange(20)
    x = 0.05 * (t - 10)
    y = np.where(t == 10, 0.004, 0.0)
    frames = [[[a, b, 0.0], [-a, -b, 0.0]] for a, b in zip(x, y, strict=True)]
    d = am.Detections.from_frames(0.1 * t, frames)
    labels = np.tile([0, 1], 20)
    right = find_exchanges(am.Tracks(detections=d, labels=labels), labels, small_model())
    assert (right.ratios < 1).all()
    swapped = np.where(d.frame_of < 12, labels, 1 - labels)
    found = find_exchanges(am.Tracks(detections=d, labels=swapped), swapped, small_model())
    best = int(found.ratios.argmax())
    assert keys_of(found, d, swapped)[best] == (12, 0, 1)
    assert found.ratios[best] > 10
    assert found.probabilities[best] > 0.6


def test_parts_of_the_capture_give_the_same_exchanges(monkeypatch):
    truth = crowd(3)
    labels, model = broken(truth, np.random.default_rng(3)), small_model(noise_sigma=0.01)
    tracks = am.Tracks(detections=truth.detections, labels=labels)
    whole = find_exchanges(tracks, labels, model)
    monkeypatch.setattr(links, "CHUNK", 7)
    parts = find_exchanges(tracks, labels, model)
    assert len(whole.ratios) > 10
    assert np.array_equal(whole.before, parts.before)
    assert np.array_equal(whole.after, parts.after)
    assert whole.ratios == pytest.approx(parts.ratios, abs=1e-9)


def test_any_number_of_threads_gives_the_same_exchanges():
    truth = crowd(3)
    labels, model = broken(truth, np.random.default_rng(3)), small_model(noise_sigma=0.01)
    tracks = am.Tracks(detections=truth.detections, labels=labels)
    one = find_exchanges(tracks, labels, model)
    for threads in (2, 3, 50):
        found = find_exchanges(tracks, labels, model, threads=threads)
        assert found.before.tobytes() == one.before.tobytes()
        assert found.after.tobytes() == one.after.tobytes()
        assert found.ratios.tobytes() == one.ratios.tobytes()


def arguments(**changes):
    model = small_model()
    times = np.array([0.0, 0.1])
    kind, F, Q = steps_of(model.motion, times)
    values = {
        "motion": motion_model(model, 3), "times": times, "kind": kind, "F": F, "Q": Q,
        "points": np.zeros((2, 3)), "frames": np.array([0, 1]), "offsets": np.array([0, 2]),
        "p_detection": 0.9, "n_threads": 1,
    }  # fmt: skip
    return values | changes


@pytest.mark.parametrize(
    "changes",
    [
        {"frames": np.array([0, 2])},
        {"frames": np.array([1, 0])},
        {"frames": np.array([0, 0])},
        {"frames": np.array([-1, 0])},
        {"frames": np.array([0])},
        {"offsets": np.array([0, 3])},
        {"offsets": np.array([0, 1])},
        {"offsets": np.array([2, 0])},
        {"offsets": np.array([], dtype=np.int64)},
        {"points": np.zeros((2, 2))},
        {"points": np.full((2, 3), np.nan)},
        {"points": np.full((2, 3), np.inf)},
        {"kind": np.array([0, 1], dtype=np.int32)},
        {"times": np.array([0.0])},
        {"p_detection": 1.0},
        {"p_detection": np.nan},
        {"p_detection": -0.1},
        {"n_threads": 0},
    ],
)
def test_damaged_input_is_refused(changes):
    _engine.exchanges(**arguments())
    with pytest.raises(ValueError, match=":"):
        _engine.exchanges(**arguments(**changes))
