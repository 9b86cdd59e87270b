"""The tracker of large scenes: starts, life cycle, and the same bytes however it runs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.large.tracker import LAG
from asterism.model.compiled import motion_model, no_transition, score_model, transition
from tests.large.scenes import MODEL, dense, labels_of
from tests.references.large import chi2, starts


def digest(labels):
    return b"".join(own.tobytes() for own in labels)


def test_the_bytes_are_the_same_for_every_tiling_and_number_of_threads():
    d = dense(n=160, frames=13).detections
    whole = digest(labels_of(d, tile=np.inf))
    for side in (2.0, 0.6, 0.37, 0.17):
        assert digest(labels_of(d, tile=side)) == whole
    with ThreadPoolExecutor(3) as pool:
        assert digest(labels_of(d, tile=0.5, threads=3, mapper=pool.map)) == whole
    assert digest(labels_of(d)) == whole


def test_a_dense_scene_is_tracked():
    corrupted = dense(n=400, frames=50)
    labels = np.concatenate(labels_of(corrupted.detections))
    tracks = am.Tracks(detections=corrupted.detections, labels=labels)
    assert am.evaluate(tracks, corrupted).idf1 > 0.99


def test_the_look_ahead_keeps_tracks_apart():
    corrupted = dense(n=600, frames=40, density=160.0)
    scores = []
    for look_ahead in (0, 1):
        labels = np.concatenate(labels_of(corrupted.detections, look_ahead=look_ahead))
        tracks = am.Tracks(detections=corrupted.detections, labels=labels)
        scores.append(am.evaluate(tracks, corrupted).idf1)
    assert scores[1] > scores[0]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("n_frames", "max_missed"), [(4, 1), (3, 0)])
def test_starts_are_those_of_the_reference(seed, n_frames, max_missed):
    d = dense(n=25, frames=n_frames, seed=seed, density=60.0).detections
    gate, frames = chi2(3, 1e-4), list(d)
    wanted = starts(MODEL, frames, gate=gate, min_detections=3, max_missed=max_missed)
    steps = [no_transition(MODEL.motion), *[transition(MODEL.motion, 1.0)] * (n_frames - 1)]
    for n_threads in (1, 3):
        paths, states, scores, gaps = _engine.find_starts(
            motion_model(MODEL, 3), score_model(MODEL),
            _engine.StartOptions(
                gate=gate, min_detections=3, max_missed=max_missed, min_score=0.0, max_chains=10**6
            ),
            times=d.times, F=np.stack([s[0] for s in steps]), Q=np.stack([s[1] for s in steps]),
            offsets=d.offsets, points=d.points, n_threads=n_threads,
        )  # fmt: skip
        assert [tuple(path) for path in paths.tolist()] == [path for _, path in wanted]
        np.testing.assert_allclose(scores, [score for score, _ in wanted], rtol=1e-9)
        assert states.shape == (len(wanted), 10)
        assert gaps.tolist() == [int(path[-1] < 0) for _, path in wanted]


def test_the_order_of_the_detections_does_not_matter():
    d = dense(n=80, frames=12).detections
    rng = np.random.default_rng(3)
    orders = [rng.permutation(n) for n in d.counts]
    mixed = am.Detections.from_frames(d.times, [d.frame(t)[o] for t, o in enumerate(orders)])
    one, two = labels_of(d), labels_of(mixed)
    pairs = {(a, b) for t, o in enumerate(orders) for a, b in zip(one[t][o], two[t], strict=True)}
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def test_a_state_is_a_value():
    d = dense(n=40, frames=12).detections
    tracker = am.large.LargeTracker(model=MODEL)
    state = tracker.init()
    for time, points in d.part(0, 8):
        state, _ = tracker.step(state, time, points)
    ends = []
    for _ in range(2):
        fork, labels = state, []
        for time, points in d.part(8, 12):
            fork, decided = tracker.step(fork, time, points)
            labels += [frame.labels for frame in decided]
        labels += [frame.labels for frame in tracker.finish(fork)[1]]
        ends.append(digest(labels))
        tracker.finish(state)
    assert ends[0] == ends[1]


def test_the_state_does_not_grow():
    tracker = am.large.LargeTracker(model=MODEL)
    state, n_decided = tracker.init(), 0
    rng = np.random.default_rng(1)
    for t in range(60):
        points = rng.uniform(0, 1, (30, 3))  # clutter alone: every start must be given up
        state, decided = tracker.step(state, float(t), points)
        n_decided += len(decided)
        assert len(state.frames) <= LAG + tracker.look_ahead
        assert len(state.tracks) < 60
    assert n_decided == 60 - LAG - tracker.look_ahead


def test_frames_without_detections_and_long_pauses():
    d = dense(n=30, frames=24).detections
    frames = [d.frame(t) if t % 12 < 10 else np.zeros((0, 3)) for t in range(24)]
    times = [t if t < 12 else t + 1000.0 for t in range(24)]
    labels = labels_of(am.Detections.from_frames(times, frames))
    assert [len(own) for own in labels] == [len(points) for points in frames]
    before = {k for own in labels[:10] for k in own.tolist()} - {-1}
    after = {k for own in labels[12:] for k in own.tolist()} - {-1}
    assert before
    assert after
    assert not before & after


@pytest.mark.parametrize("n_frames", [0, 1, 2, 3, 4, 5])
def test_short_scenes(n_frames):
    truth = am.simulate.cube(frames=max(n_frames, 1), side=3.0, seed=1)
    labels = labels_of(truth.detections.part(0, n_frames))
    assert len(labels) == n_frames
    if n_frames >= 4:
        assert all(sorted(own.tolist()) == list(range(8)) for own in labels)


def test_several_motions():
    corrupted = dense(n=60, frames=16)
    own = MODEL.motion
    two = tuple(am.DWNA(acceleration_sigma=a, velocity_sigma=0.05) for a in (0.008, 0.02))
    motion = am.InteractingMotions(models=two, transitions=np.array([[0.9, 0.1], [0.1, 0.9]]))
    model = am.TrackingModel(motion=motion, sensor=MODEL.sensor, population=MODEL.population)
    assert own != motion
    ends = []
    for side in (np.inf, 0.2):
        tracker = am.large.LargeTracker(model=model, tile=side)
        state, labels = tracker.init(), []
        for time, points in corrupted.detections:
            state, decided = tracker.step(state, time, points)
            labels += [frame.labels for frame in decided]
        labels += [frame.labels for frame in tracker.finish(state)[1]]
        ends.append(labels)
    assert digest(ends[0]) == digest(ends[1])
    tracks = am.Tracks(detections=corrupted.detections, labels=np.concatenate(ends[0]))
    assert am.evaluate(tracks, corrupted).idf1 > 0.95


def test_confirmed_labels_have_no_holes():
    labels = np.concatenate(labels_of(dense(n=100, frames=20).detections))
    found = np.unique(labels[labels >= 0])
    assert found.tolist() == list(range(len(found)))


def test_bad_frames_are_refused():
    tracker = am.large.LargeTracker(model=MODEL)
    state, _ = tracker.step(tracker.init(), 1.0, np.zeros((2, 3)))
    for time, points in ((1.0, np.zeros((2, 3))), (2.0, np.zeros((2, 2))), (2.0, [[0, np.nan, 0]])):
        with pytest.raises(am.ParameterError):
            tracker.step(state, time, points)
    for options in ({"tile": 0}, {"threads": 0}, {"n_axes": 4}, {"look_ahead": 9}, {"gate": 3}):
        with pytest.raises(am.ParameterError, match=next(iter(options))):
            am.large.LargeTracker(model=MODEL, **options)


def test_the_model_of_a_dense_scene_is_estimated():
    """Unambiguous links are those of slow markers here, so the usual estimate can fail."""
    d = dense(n=250, frames=15, density=130.0).detections
    model = am.large.estimate_from_start(d)
    assert model.sensor.p_detection == pytest.approx(0.95, abs=0.03)
    assert model.sensor.noise_sigma == pytest.approx(0.005, rel=0.3)
    assert 0.03 < model.velocity_sigma(3) < 0.07
