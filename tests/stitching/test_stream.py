"""Stitching frame by frame."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import asterism as am
from asterism.model.compiled import no_transition, transition
from asterism.simulate import Burst, Ghosts
from tests.scenes import SANITIZED, sized, stitched

MODEL = am.TrackingModel(
    motion=am.RandomWalk(walk_sigma=0.05),
    sensor=am.Sensor(noise_sigma=1e-3, p_detection=0.99, clutter_density=1e-3),
    population=am.Population(birth_density=1e-2, p_disappear=1e-3, max_speed=2, max_gap=4),
)

FRAMES = sized(300, 100)


@functools.cache
def disturbed(seed, frames=FRAMES):
    """A person and its model."""
    truth = am.simulate.person(seed=seed, frames=frames)
    truth = am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed)
    return truth, MODEL if SANITIZED else am.estimate_model(truth.detections).model


def streamed(method, detections, model):
    """Labels in the end, as they were reported first, the frame in which they changed last."""
    state = method.init(model, n_axes=detections.n_axes, seed=1)
    final = np.full(detections.n_points, -1)
    first, when = final.copy(), final.copy()
    for t, (time, points) in enumerate(detections):
        state, update = method.step(state, time, points)
        frame = slice(detections.offsets[t], detections.offsets[t + 1])
        final[frame] = first[frame] = update.labels
        final[update.revised] = update.revised_labels
        when[frame] = when[update.revised] = t
        assert (update.revised < detections.offsets[t]).all()
    return state, final, first, when


@functools.cache
def streamed_person(seed):
    """The same of a person, by the method as it is."""
    truth, model = disturbed(seed)
    return streamed(am.tracking.Stitched(), truth.detections, model)


@pytest.mark.parametrize(
    ("method", "seed"),
    [
        *((am.SMP(window=3), seed) for seed in range(3)),
        *((am.GNN(), seed) for seed in range(3)),
        *((am.MCMCDA(confidence=0), seed) for seed in range(2)),
    ],
)
def test_a_stream_is_as_good_as_the_whole_capture(method, seed):
    truth, model = disturbed(seed)
    d = truth.detections
    whole = am.evaluate(stitched(d, method, model=model, seed=1).tracks, truth)
    if method == am.tracking.Stitched().method:
        state, labels, *_ = streamed_person(seed)
    else:
        state, labels, *_ = streamed(am.tracking.Stitched(method=method), d, model)
    e = am.evaluate(am.Tracks(detections=d, labels=labels), truth)
    assert e.idf1 > whole.idf1 - 0.005
    assert e.switches_per_1000 < 0.6
    assert state.n_seen == d.n_points
    assert state.info["joins"] > 10


@pytest.mark.parametrize("seed", range(3))
def test_what_comes_back_is_guessed_soon(seed):
    truth, _ = disturbed(seed)
    d = truth.detections
    method = am.tracking.Stitched()
    _, final, first, when = streamed_person(seed)
    frame = d.frame_of
    late = when - frame
    # With confirm 15, a gap of 4 and 2 frames that wait nothing changes after 22.
    assert method.confirm < late.max() <= 22
    known = (frame > method.confirm + 10) & (final >= 0)
    assert np.mean(first[known] == final[known]) > 0.95
    is_back = known.copy()
    is_back[known] = [
        not (final[frame == t - 1] == k).any()
        for t, k in zip(frame[known], final[known], strict=True)
    ]
    assert is_back.sum() > 15
    assert np.median(late[is_back]) <= 5
    for t in range(d.n_frames):  # the report of a frame names no marker twice
        own = first[d.offsets[t] : d.offsets[t + 1]]
        assert len(set(own[own >= 0])) == (own >= 0).sum()


def test_run_is_the_loop_over_step():
    truth, model = disturbed(1)
    d = truth.detections
    _, labels, *_ = streamed_person(1)
    tracks = am.track(d, am.tracking.Stitched(), model=model, seed=1)
    np.testing.assert_array_equal(tracks.labels, labels)
    assert tracks.info["joins"] > sized(10, 2)


def test_a_state_is_a_value():
    truth, model = disturbed(1, frames=100)
    frames = list(truth.detections)
    method = am.tracking.Stitched()
    state = method.init(model)
    for time, points in frames[:60]:
        state, _ = method.step(state, time, points)

    def go_on(state):
        updates = []
        for time, points in frames[60:100]:
            state, update = method.step(state, time, points)
            updates.append((update.labels, update.revised, update.revised_labels))
        return updates

    for one, other in zip(go_on(state), go_on(state), strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


class Separate(am.tracking.Method):
    """A method whose steps the engine does not stitch in the same call."""

    name = "separate"

    def __init__(self, method):
        self.method, self.window = method, getattr(method, "window", 3)

    def init(self, model, **options):
        return self.method.init(model, **options)

    def step(self, state, time, points, **options):
        return self.method.step(state, time, points, **options)


@pytest.mark.parametrize("method", [am.GNN(), am.SMP(window=3), am.TOMHT()], ids=lambda m: m.name)
def test_neither_a_call_for_both_nor_a_look_ahead_changes_a_result(method):
    truth, model = disturbed(2)
    at_once = am.tracking.Stitched(method=method)
    apart = am.tracking.Stitched(method=Separate(method))
    state = ahead = at_once.init(model)
    other = apart.init(model)
    n_revised = 0  # frames that revise what was stitched ahead of them
    for t, (time, points) in enumerate(truth.detections):
        own = None if t % 5 else np.tile(1e-8 * np.eye(3), (len(points), 1, 1))
        state, update = at_once.step(state, time, points, covariances=own)
        if t % 7:
            at_once.prepare(ahead)
        ahead, prepared = at_once.step(ahead, time, points, covariances=own)
        other, separate = apart.step(other, time, points, covariances=own)
        for same in (prepared, separate):
            for name in ("labels", "revised", "revised_labels"):
                np.testing.assert_array_equal(getattr(same, name), getattr(update, name))
            for name in ("ids", "gaps", "log_odds", "means", "covariances"):
                a, b = getattr(same.tracks, name), getattr(update.tracks, name)
                np.testing.assert_array_equal(a, b)
        first = truth.detections.offsets[max(t - 2, 0)]
        n_revised += np.any((update.revised >= first) & (update.revised < first + len(points)))
    assert n_revised > sized(5, 0)
    assert state.info == ahead.info == other.info


def test_empty_frames_and_two_axes():
    rng = np.random.default_rng(0)
    corner = rng.uniform(0, 1, (8, 2))
    method = am.tracking.Stitched(confirm=5)
    state = method.init(MODEL, n_axes=2)
    for t in range(60):
        points = corner + 0.002 * t
        if 30 <= t < 40:
            points = np.empty((0, 2))
        state, update = method.step(state, t / 100, points)
        assert len(update.labels) == len(points)
    assert sorted(update.labels) == list(range(8))


def test_an_endless_run_remembers_what_it_may():
    rng = np.random.default_rng(3)
    _, model = disturbed(0)
    method = am.tracking.Stitched(max_occlusion=50, confirm=3)
    state = method.init(model)
    place = np.zeros(3)
    for t in range(sized(1500, 300)):
        if t % 12 == 0:  # one is gone for good, another comes
            place = rng.uniform(-5, 5, 3)
        state, _ = method.step(state, t / 100, place[None] if t % 12 < 6 else [])
    assert state.stitcher.n_markers > sized(100, 20)
    assert state.stitcher.n_remembered <= 6


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        ({"method": "smp"}, "method"),
        ({"lag": -1}, "lag"),
        ({"confirm": 1}, "confirm"),
        ({"max_occlusion": 0}, "max_occlusion"),
        ({"ghost_radius": float("nan")}, "ghost_radius"),
    ],
)
def test_options_out_of_range_are_refused(wrong, name):
    with pytest.raises(am.ParameterError, match=name):
        am.tracking.Stitched(**wrong)


@pytest.mark.parametrize(("time", "points"), [(0.0, []), (-1, []), (1, [[np.nan] * 3])])
def test_frames_that_are_wrong_are_refused(time, points):
    method = am.tracking.Stitched()
    state = method.init(MODEL)
    state, _ = method.step(state, 0.0, [[0, 0, 0]])
    with pytest.raises(am.ParameterError):
        method.step(state, time, points)


def test_a_stitcher_in_place_reports_what_its_copies_report():
    truth, model = disturbed(1)
    method, model = am.SMP(window=3), am.tracking.tracklet_model(model)
    state, own = method.init(model), am.tracking.Stitched(method=method).init(model).stitcher
    copied, last = own.copy(), None
    for time, points in truth.detections:
        state, found = method.step(state, time, points)
        motion = model.motion
        step = no_transition(motion) if last is None else transition(motion, time - last)
        given = *step, points, found.labels, found.revised, found.revised_labels
        copied, last = copied.copy(), time
        for one, other in zip(own.step(*given), copied.step(*given), strict=True):
            assert np.array_equal(one, other)
    assert own.n_joins > 0
