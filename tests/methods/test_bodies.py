"""Occluded markers carried by their neighbours: places, variances, what trackers make of them."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import asterism as am
from asterism import _engine
from asterism.simulate import Burst, Ghosts
from asterism.tracking import Rigidity
from tests.references.rigid_body import BodyByHand
from tests.scenes import SANITIZED, sized

SIGMA = 1e-3
METHODS = {
    "gnn": am.GNN,
    "smp": am.SMP,
    "jpda": am.JPDA,
    "smp of the past": functools.partial(am.SMP, window=3),
    "splitting": am.TrackSplitting,
    "tomht": am.TOMHT,
    "mda": am.MDA,
    "mht": am.MHT,
}
BY_BRANCHES = [METHODS[n] for n in ("smp of the past", "splitting", "tomht", "mda")]
each_method = pytest.mark.parametrize("make", METHODS.values(), ids=METHODS)


def turning(rng, n_frames, n_axes, n_markers=7, bend=0.0, speed=1.0):
    """A body that turns and goes, seen with noise; markers breathe by `bend`."""
    shape = rng.uniform(-0.2, 0.2, (n_markers, n_axes))
    wave = rng.normal(0, bend, shape.shape)
    phase = rng.uniform(0, 2 * np.pi, n_markers)
    frames = []
    for t in range(n_frames):
        own = shape + wave * np.sin(0.2 * t + phase)[:, None]
        a, b = 0.03 * speed * t, 0.02 * speed * t
        R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        if n_axes == 3:
            turn = np.eye(3)
            turn[:2, :2] = R
            tilt = np.eye(3)
            tilt[1:, 1:] = [[np.cos(b), -np.sin(b)], [np.sin(b), np.cos(b)]]
            R = tilt @ turn
        frames.append(own @ R.T + 0.01 * speed * t)
    truth = np.array(frames)
    return truth, truth + rng.normal(0, SIGMA, truth.shape)


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("n_seen", [1, 2, 3, 6])
@pytest.mark.parametrize("bend", [0.0, 4e-3])
def test_carried_places_are_those_by_hand(n_axes, n_seen, bend):
    rng = np.random.default_rng(7 + n_seen)
    _, seen = turning(rng, 110, n_axes, bend=bend)
    by_hand = BodyByHand(n_axes, SIGMA)
    engine = _engine.RigidCarrier(n_axes=n_axes, noise_sigma=SIGMA)
    n_carried = 0
    for t, points in enumerate(seen):
        others = np.arange(1, n_seen + 1) if t >= 80 else np.arange(1, 7)
        if t > 80 and t % 5 == 1:
            carried = engine.carry(0, others, points[others])
            at, variance, n = by_hand.carry(0, others, points[others])
            np.testing.assert_allclose(carried[0], at, atol=1e-9)
            np.testing.assert_allclose(carried[1], variance, rtol=1e-6)
            assert carried[2] == n
            n_carried += 1
        ids = np.append(0, others) if t < 80 else others
        engine.see(ids, points[ids])
        by_hand.see(ids, points[ids])
    assert n_carried == 6


def normalised_errors(n_axes, bend, n_bodies=40):
    """Squared errors of carried places over their variances, by the frames occluded."""
    found: dict[int, list[float]] = {gap: [] for gap in (1, 5, 20, 39)}
    for seed in range(n_bodies):
        rng = np.random.default_rng(seed)
        truth, seen = turning(rng, 180, n_axes, bend=bend)
        engine = _engine.RigidCarrier(n_axes=n_axes, noise_sigma=SIGMA)
        ids = np.arange(7)
        for t, points in enumerate(seen):
            if (gap := t - 140) in found:
                at, variance, _ = engine.carry(0, ids, points[ids])
                found[gap].append(((at - truth[t, 0]) ** 2).sum() / n_axes / variance)
            if t == 140:
                ids = np.arange(1, 7)
            engine.see(ids, points[ids])
    return {gap: float(np.mean(each)) for gap, each in found.items()}


@pytest.mark.parametrize("n_axes", [2, 3])
def test_the_variance_is_meant_where_nothing_bends(n_axes):
    # The variance may be larger than need be: bodies may bend on, and these do not.
    found = normalised_errors(n_axes, 0.0)
    assert 0.4 < found[1] < 1.4
    assert 0.4 < found[5] < 1.4
    assert all(0.2 < value < 1.4 for value in found.values())


@pytest.mark.parametrize("n_axes", [2, 3])
def test_the_variance_is_meant_where_bodies_bend(n_axes):
    found = normalised_errors(n_axes, 5e-3)
    assert all(0.2 < value < 2 for value in found.values())


def test_neighbours_in_a_line_do_not_turn_a_marker():
    rng = np.random.default_rng(3)
    line = np.column_stack([np.linspace(0.1, 0.5, 5), np.zeros((5, 2))])
    shape = np.vstack([[0.3, 0.1, 0.0], line])
    engine = _engine.RigidCarrier(n_axes=3, noise_sigma=SIGMA)
    for _ in range(80):
        engine.see(np.arange(6), shape + rng.normal(0, SIGMA, shape.shape))
    for _ in range(5):
        engine.see(np.arange(1, 6), line + rng.normal(0, SIGMA, line.shape))
    at, variance, n = engine.carry(0, np.arange(1, 6), line)
    assert n == 5
    assert np.linalg.norm(at - shape[0]) < 6 * SIGMA
    assert np.isfinite(variance)
    # A fit about the line alone would leave the marker anywhere around it, 0.1 m off.
    assert variance == pytest.approx(0.03**2, rel=0.05)


def test_markers_without_bonds_carry_no_other():
    rng = np.random.default_rng(4)
    place, engine = rng.uniform(-1, 1, (6, 3)), _engine.RigidCarrier(n_axes=3, noise_sigma=SIGMA)
    for _ in range(100):
        place = place + rng.normal(0, 0.05, place.shape)
        engine.see(np.arange(6), place)
    assert sum(engine.n_bonds(k) for k in range(6)) == 0
    engine.see(np.arange(1, 6), place[1:])
    assert engine.carry(0, np.arange(1, 6), place[1:]) is None


def test_a_forgotten_marker_is_no_neighbour():
    rng = np.random.default_rng(5)
    _, seen = turning(rng, 90, 3)
    engine = _engine.RigidCarrier(n_axes=3, noise_sigma=SIGMA)
    for points in seen[:80]:
        engine.see(np.arange(7), points)
    before = sum(engine.n_bonds(k) for k in range(7))
    engine.forget(3)
    assert before == 7 * 6
    assert sum(engine.n_bonds(k) for k in range(7)) == 6 * 5


def walk_model(**changes):
    values = {"birth_density": 1e-3, "p_disappear": 1e-4, "max_speed": 5, "max_gap": 5} | changes
    return am.TrackingModel(
        motion=am.RandomWalk(walk_sigma=0.08),  # 8 mm in a frame
        sensor=am.Sensor(noise_sigma=SIGMA, p_detection=0.98, clutter_density=1e-2),
        population=am.Population(**values),
    )


@each_method
def test_neighbours_tell_a_marker_from_a_ghost_that_moves_likelier(make):
    # All move on by 15 mm; where one of them was there is a ghost.
    rng = np.random.default_rng(8)
    shape = rng.uniform(-0.15, 0.15, (7, 3))
    frames = [shape + rng.normal(0, SIGMA, shape.shape) for _ in range(90)]
    frames.append(np.vstack([frames[0][:1], shape + np.array([0.015, 0, 0])]))
    d = am.Detections.from_frames(0.01 * np.arange(91), frames)
    found = {}
    for rigid in (None, Rigidity()):
        tracks = am.track(d, make(rigid=rigid), model=walk_model())
        found[rigid] = int(np.flatnonzero(tracks.labels[d.offsets[90] :] == tracks.labels[0])[0])
    assert found == {None: 0, Rigidity(): 1}


@each_method
def test_an_occluded_marker_keeps_its_track_when_it_comes_back(make):
    # Occluded for 40 frames, of which the model bridges 5, while the body moves and turns; a ghost
    # is beside its place: from the first on, or from the fourth for those that keep frames open and
    # decide by the best branches, to which a marker is not occluded yet in the first.
    begins = 103 if make in BY_BRANCHES else 100
    rng = np.random.default_rng(9)
    truth, seen = turning(rng, 160, 3, speed=0.3)
    frames = []
    for t, points in enumerate(seen):
        occluded = 100 <= t < 140
        ghost = truth[t, :1] + np.array([0.05, 0, 0])
        others = points[1:] if t < begins else np.vstack([ghost, points[1:]])
        frames.append(others if occluded else points)
    d = am.Detections.from_frames(0.01 * np.arange(160), frames)
    model = walk_model()
    off, on = (am.track(d, make(rigid=r), model=model).labels for r in (None, Rigidity()))
    first, back, ghosts = 0, d.offsets[140], d.offsets[begins:140]
    assert (off[ghosts] == off[first]).any()
    assert on[first] == on[back] == on[-7]
    assert (on[ghosts] != on[first]).all()


@functools.cache
def occluded_person(seed):
    truth = am.simulate.person(seed=seed, frames=sized(300, 100))
    truth = am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed)
    return truth, walk_model() if SANITIZED else am.estimate_model(truth.detections).model


@each_method
@pytest.mark.parametrize("seed", [1, 2])
def test_occluded_markers_of_a_person_come_back_as_themselves(make, seed):
    if make is am.MDA:
        pytest.skip("slow, and the same forest as TOMHT's")
    truth, model = occluded_person(seed)
    off, on = (am.track(truth.detections, make(rigid=r), model=model) for r in (None, Rigidity()))
    before, after = am.evaluate(off, truth), am.evaluate(on, truth)
    assert 1 - after.idf1 < 0.8 * (1 - before.idf1)
    # Nearly all switches of splitting are between frames in a row: of markers that are seen.
    if make is not am.TrackSplitting:
        assert after.switches_per_1000 < before.switches_per_1000
    assert on.info["carried"] > 200
    assert on.info["returned"] > 5
    assert on.info["refused"] > 100
    assert not {"carried", "returned", "refused"} & set(off.info)


@functools.cache
def corrupted(scene):
    made = getattr(am.simulate, scene)(seed=1)
    truth = am.simulate.corrupt(made, missing=0.1, clutter=0.1, noise=1e-3, seed=1)
    return truth, am.estimate_model(truth.detections).model


@each_method
@pytest.mark.parametrize("scene", ["walk", "wander", "swarm", "juggler", "attracted"])
def test_no_harm_where_there_are_no_bodies(make, scene):
    if scene == "swarm" and make is am.JPDA:
        pytest.skip("slow, and the same tracks as GNN's")
    if make is am.MDA:
        pytest.skip("slow, and the same forest as TOMHT's")
    truth, model = corrupted(scene)
    off, on = (
        am.evaluate(am.track(truth.detections, make(rigid=r), model=model), truth).idf1
        for r in (None, Rigidity())
    )
    assert on > off - 1e-3


@each_method
def test_a_stream_is_the_whole_capture_and_a_state_is_a_value(make):
    truth, model = occluded_person(1)
    middle, end = sized(100, 65), sized(140, 90)
    d = truth.detections.part(0, end)
    method = make(rigid=Rigidity())
    whole = am.track(d, method, model=model)
    state, labels, kept = method.init(model), np.full(d.n_points, -1), None
    for t, (time, points) in enumerate(d):
        if t == middle:
            kept = state
        state, update = method.step(state, time, points)
        labels[d.offsets[t] : d.offsets[t + 1]] = update.labels
        labels[update.revised] = update.revised_labels
    np.testing.assert_array_equal(labels, whole.labels)
    assert all(whole.info[name] == value for name, value in state.info.items())
    # Another future, in which bodies stretch, leaves nothing behind.
    other = kept
    for t in range(middle, end - 10):
        other, _ = method.step(other, d.times[t], 1.5 * d.frame(t)[::2])
    again, state = np.full(d.n_points, -1), kept
    for t in range(middle, end):
        state, update = method.step(state, d.times[t], d.frame(t))
        again[d.offsets[t] : d.offsets[t + 1]] = update.labels
        again[update.revised] = update.revised_labels
    np.testing.assert_array_equal(again[d.offsets[middle] :], labels[d.offsets[middle] :])


@pytest.mark.parametrize("make", [am.SMP, am.TrackSplitting, am.TOMHT, am.MHT])
def test_a_window_beyond_the_longest_gap_carries_too(make):
    # What is learnt of decided frames alone ends before the gap begins: were a marker carried only
    # once it is known there as occluded, its track would be over by then.
    rng = np.random.default_rng(12)
    _, seen = turning(rng, 150, 3, speed=0.3)
    frames = [points[1:] if 100 <= t < 130 else points for t, points in enumerate(seen)]
    d = am.Detections.from_frames(0.01 * np.arange(150), frames)
    labels = am.track(d, make(window=8, rigid=Rigidity()), model=walk_model(max_gap=4)).labels
    assert labels[0] == labels[d.offsets[130]] == labels[-7] >= 0


@pytest.mark.parametrize("make", [METHODS[n] for n in ("gnn", "smp of the past", "tomht", "mht")])
def test_carrying_ends_in_time(make):
    truth, model = occluded_person(1)
    longest = {}
    for limit in (1, 30, 60):
        method = make(rigid=Rigidity(max_gap=limit))
        state, gaps = method.init(model), [0]
        for time, points in truth.detections.part(0, 200):
            state, _ = method.step(state, time, points)
            gaps.append(max(state.live()["gaps"], default=0))
        longest[limit] = max(gaps)
    d_most = model.population.max_gap
    assert longest[1] <= d_most + 1
    assert d_most < longest[60] <= 60 + d_most
    assert longest[30] <= 30 + d_most


@pytest.mark.parametrize(
    ("make", "options", "name"),
    [
        (am.GNN, {"rigid": "yes"}, "rigid: expected a Rigidity"),
        (am.TOMHT, {"rigid": True}, "rigid: expected a Rigidity"),
        (Rigidity, {"max_gap": 0}, "rigid.max_gap"),
        (am.TrackSplitting, {"rigid": Rigidity(), "independent": True}, "rigid"),
        (am.SMP, {"rigid": Rigidity(), "strict": True}, "rigid"),
    ],
)
def test_options_out_of_range_are_refused(make, options, name):
    with pytest.raises(am.ParameterError, match=name):
        make(**options)
