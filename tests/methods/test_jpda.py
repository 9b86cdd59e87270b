"""Joint probabilistic data association: exact marginals, existence, coalescence, confidence."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

import asterism as am
from asterism.solve import joint_marginals
from tests.references.jpda import jpda_by_hand
from tests.scenes import calibration_in_crowds, crowd, interacting, small_model


@pytest.mark.parametrize("options", [{}, {"guard": False}, {"sure_until_gap": False}])
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
@pytest.mark.parametrize("seed", range(2))
def test_labels_and_confidence_are_those_of_the_reference_implementation(options, motion, seed):
    truth = crowd(seed, n_axes=2 + seed % 2)
    slow = am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3)
    model = small_model(
        motion=slow if motion == "dwna" else interacting(), noise_sigma=0.01, max_speed=1.5,
        clutter_density=3.0, birth_density=1.0,
    )  # fmt: skip
    method = am.JPDA(**options)
    labels, confidence = jpda_by_hand(truth.detections, method, model)
    tracks = am.track(truth.detections, method, model=model)
    assert (tracks.labels == labels).all()
    # States that come by two ways of rounding meet again only so far.
    assert abs(tracks.confidence - confidence).max() < 1e-8
    doubtful = (confidence > 0.01) & (confidence < 0.99)
    assert doubtful.sum() > 5
    assert labels.max() >= 2


def test_marginals_and_existence_are_those_of_all_that_may_have_happened():
    # Each track exists or not, and if so is seen or not; every detection is of a track or clutter.
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(2000):
        n, m, D = rng.integers(1, 4), rng.integers(0, 4), rng.integers(2, 4)
        r, P_d = rng.uniform(0.01, 0.999, n), rng.uniform(0.5, 0.99)
        clutter, birth = rng.uniform(0.1, 3), rng.uniform(0.01, 0.5)
        S = rng.uniform(0.05, 1.0, n)
        expected, points = rng.uniform(-1, 1, (n, D)), rng.uniform(-1, 1, (m, D))
        square = ((points[None] - expected[:, None]) ** 2).sum(axis=2)
        density = np.exp(-0.5 * square / S[:, None]) / (2 * np.pi * S[:, None]) ** (D / 2)
        beta, alive = np.zeros((n, m + 1)), np.zeros(n)
        total = 0.0
        for event in itertools.product(range(-2, m), repeat=int(n)):  # -2: is not, -1: not seen
            used = [j for j in event if j >= 0]
            if len(used) > len(set(used)):
                continue
            weight = (clutter + P_d * birth) ** (m - len(used))
            for i, j in enumerate(event):
                weight *= (
                    1 - r[i] if j == -2
                    else r[i] * (1 - P_d) if j == -1
                    else r[i] * P_d * density[i, j]
                )  # fmt: skip
            total += weight
            for i, j in enumerate(event):
                beta[i, j if j >= 0 else m] += weight
                alive[i] += weight * (j > -2)
        weights = np.log(r[:, None] * P_d * density / (clutter + P_d * birth))
        found = joint_marginals(weights.reshape(n, m), np.log(1 - r * P_d)).marginals
        worst = max(worst, abs(found - beta / total).max())
        after = 1 - found[:, m] + found[:, m] * r * (1 - P_d) / (1 - r * P_d)
        worst = max(worst, abs(after - alive / total).max())
    assert worst < 1e-12


def side_by_side(seed: int, gap: float, n_frames: int = 220) -> tuple[am.Tracks, am.TrackingModel]:
    """Two markers that come together, run side by side for 200 frames, and are always seen."""
    rng = np.random.default_rng(seed)
    apart = np.full(n_frames, gap)
    apart[:20] = np.linspace(0.3, gap, 20)
    path = 0.02 * np.arange(n_frames)
    positions = np.zeros((n_frames, 2, 3))
    positions[:, :, 0] = path[:, None]
    positions[:, 0, 1], positions[:, 1, 1] = apart / 2, -apart / 2
    positions += rng.normal(0, 0.01, positions.shape)
    model = small_model(
        motion=am.DWNA(acceleration_sigma=0.5, velocity_sigma=0.5), noise_sigma=0.01,
        clutter_density=0.01, birth_density=0.001, p_detection=0.95,
    )  # fmt: skip
    return am.Tracks.from_dense(0.1 * np.arange(n_frames), positions), model


def closest(method: am.JPDA, truth: am.Tracks, model: am.TrackingModel) -> float:
    """Least distance of the two tracks' states over the last 100 frames."""
    state, distances = method.init(model), []
    for time, points in truth.detections:
        state, _ = method.step(state, time, points)
        live = state.live()
        if len(live["ids"]) == 2:
            distances.append(np.linalg.norm(live["means"][0, :, 0] - live["means"][1, :, 0]))
    assert len(distances) > 200
    return float(np.median(distances[-100:]))


@pytest.mark.parametrize("seed", range(5))
def test_tracks_side_by_side_coalesce_without_the_guard_and_not_with_it(seed):
    gap = 0.02  # two standard deviations of a coordinate
    truth, model = side_by_side(seed, gap)
    assert closest(am.JPDA(guard=False), truth, model) < 0.3 * gap
    assert closest(am.JPDA(), truth, model) > 0.7 * gap


def test_the_guard_acts_on_states_alone_and_only_where_tracks_share_points():
    truth, model = side_by_side(1, 0.03)
    guarded, free = am.JPDA(), am.JPDA(guard=False)
    on, off = guarded.init(model), free.init(model)
    for time, points in truth.detections:
        (on, a), (off, b) = guarded.step(on, time, points), free.step(off, time, points)
        assert (a.labels == b.labels).all()
        assert (a.confidence == b.confidence).all()
        if (on.live()["means"] != off.live()["means"]).any():
            break
    assert a.info["largest_group"] > 1
    assert on.tracker.n_frames < truth.detections.n_frames  # they did part, with equal marginals


def heap(rng: np.random.Generator, n: int) -> tuple[am.Detections, am.TrackingModel]:
    """Markers in a heap of a few centimetres: every track may have every point."""
    model = small_model(
        motion=am.RandomWalk(walk_sigma=0.2), noise_sigma=0.02, clutter_density=1e-3,
        birth_density=0.01, p_detection=0.95,
    )  # fmt: skip
    still = rng.normal(0, 0.03, (n, 3))
    frames = [still + rng.normal(0, 0.02, (n, 3)) for _ in range(20)]
    return am.Detections.from_frames(0.1 * np.arange(20), frames), model


def test_a_group_too_large_is_summed_over_a_beam_and_says_so():
    d, model = heap(np.random.default_rng(1), 16)
    exact = am.track(d, am.JPDA(max_states=2**16), model=model)
    assert (exact.info["bound"], exact.info["approximate_groups"]) == (0, 0)
    method = am.JPDA(max_states=8)
    beam = am.track(d, method, model=model)
    assert beam.info["approximate_groups"] > 0
    assert 0 < beam.info["bound"] <= 1
    assert beam.info["most_states"] < exact.info["most_states"]
    # Step by step the bounds are the same, and the run reports the largest.
    state, bounds = method.init(model), []
    for time, points in d:
        state, update = method.step(state, time, points)
        bounds.append(update.info["bound"])
    assert max(bounds) == beam.info["bound"]


def test_groups_beyond_the_guard_are_counted():
    d, model = heap(np.random.default_rng(2), 12)
    assert am.track(d, am.JPDA(), model=model).info["unguarded_groups"] > 0
    assert am.track(d, am.JPDA(guard=False), model=model).info["unguarded_groups"] == 0


def test_a_track_that_is_not_seen_exists_less_and_less():
    model = small_model(p_disappear=0.01, max_gap=30, p_redetection=None)
    frames = [[[0.0, 0, 0]]] * 20 + [[]] * 8
    by_gap, by_odds = [], []
    for method, odds in ((am.JPDA(), by_gap), (am.JPDA(sure_until_gap=False), by_odds)):
        state = method.init(model)
        for t, points in enumerate(frames):
            state, _ = method.step(state, 0.1 * t, points)
            odds.append(state.live()["log_odds"])
    r = 1 / (1 + np.exp(-np.array([*by_odds[20], *by_odds[21]])))
    before = 1 / (1 + math.exp(-by_odds[19][0]))
    # (1 - p_z), then a miss: r (1 - P_d) / (1 - r P_d), by hand.
    predicted = 0.99 * before
    assert r[0] == pytest.approx(predicted * 0.1 / (1 - 0.9 * predicted), rel=1e-9)
    assert r[1] < r[0] < before
    assert len(by_odds[-1]) == 0  # it ended, long before 30 misses
    assert len(by_gap[-1]) == 1  # this one continues, with the same low existence
    assert by_gap[20] == pytest.approx(by_odds[20], abs=1e-9)


def test_confidence_is_calibrated_where_the_model_is_right():
    found = calibration_in_crowds(am.JPDA())
    assert found.auc > 0.85
    assert found.ece < 0.015


def test_options_are_checked():
    for wrong in ({"max_states": 0}, {"max_states": 2**31}, {"guard": 1}, {"sure_until_gap": None}):
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.JPDA(**wrong)
    assert dataclasses.replace(am.JPDA(), guard=False) == am.tracking.method_by_name(
        "jpda", guard=False
    )
