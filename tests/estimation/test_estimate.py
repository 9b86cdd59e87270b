"""The model from the clip: near the truth where there is one, sensible on whatever comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism.tracking.estimation.occlusions import Sightings, count_sightings
from tests.scenes import wanderers


@pytest.mark.parametrize("seed", range(3))
def test_the_scale_of_everything_is_found(seed):
    rng = np.random.default_rng(seed)
    truth = wanderers(rng, n_markers=12, n_frames=250, missing=0.15, clutter=2.0)
    model = am.estimate_model(truth.detections).model
    assert 0.8 < model.sensor.noise_sigma / 0.005 < 1.25
    seen = (truth.labels >= 0).mean() * truth.detections.n_points / (12 * 250)
    assert model.sensor.p_detection == pytest.approx(seen, abs=0.02)
    volume = np.prod(np.ptp(truth.detections.points, axis=0))
    clutter = (truth.labels < 0).sum() / 250
    assert model.sensor.clutter_density * volume == pytest.approx(clutter, rel=0.15)
    levels = [mode.acceleration_sigma for mode in model.motion.modes]
    assert 0.6 < levels[len(levels) // 2] / 1.5 < 1.7
    assert model.population.max_gap >= 4


def test_two_kinds_of_motion_are_distinguished():
    # Half of the markers rest; the others accelerate at random, far beyond their noise.
    rng = np.random.default_rng(1)
    n = 300
    still = np.cumsum(rng.normal(0, 1e-5, (n, 10, 3)), axis=0)
    moving = np.cumsum(np.cumsum(rng.normal(0, 0.01, (n, 10, 3)), axis=0) * 0.1, axis=0)
    positions = np.concatenate([still, moving], axis=1) + rng.uniform(-5, 5, (20, 3))
    positions += rng.normal(0, 1e-4, positions.shape)
    truth = am.Tracks.from_dense(np.arange(n) * 0.1, positions)
    estimate = am.estimate_model(truth.detections)
    levels = [mode.acceleration_sigma for mode in estimate.model.motion.modes]
    assert len(levels) == 3
    assert levels[0] < 0.1 * levels[1]
    assert am.evaluate(am.track(truth.detections, model=estimate.model), truth).idf1 > 0.99


def test_the_order_within_a_frame_changes_nothing():
    rng = np.random.default_rng(2)
    d = wanderers(rng, n_frames=60).detections
    order = np.concatenate(
        [rng.permutation(np.arange(a, b)) for a, b in zip(d.offsets, d.offsets[1:], strict=False)]
    )
    shuffled = am.Detections(times=d.times, offsets=d.offsets, points=d.points[order])
    a, b = am.estimate_model(d).model, am.estimate_model(shuffled).model
    assert a.sensor.noise_sigma == pytest.approx(b.sensor.noise_sigma, rel=1e-6)
    assert a.population.max_speed == pytest.approx(b.population.max_speed, rel=1e-6)
    assert replace(a.population, max_speed=1) == replace(b.population, max_speed=1)


def test_the_same_capture_gives_the_same_model():
    d = wanderers(np.random.default_rng(3), n_frames=60).detections
    assert am.estimate_model(d).model == am.estimate_model(d).model


def test_lengths_in_another_unit_scale_with_it():
    d = wanderers(np.random.default_rng(4), n_frames=60).detections
    double = am.Detections(times=d.times, offsets=d.offsets, points=d.points * 2)
    a, b = am.estimate_model(d).model, am.estimate_model(double).model
    assert b.sensor.noise_sigma == pytest.approx(2 * a.sensor.noise_sigma, rel=0.05)
    assert b.population.max_speed == pytest.approx(2 * a.population.max_speed, rel=0.05)
    assert b.sensor.clutter_density == pytest.approx(a.sensor.clutter_density / 8, rel=0.05)


def test_reasons_name_every_parameter():
    estimate = am.estimate_model(wanderers(np.random.default_rng(5)).detections)
    text = str(estimate)
    for symbol in ("σ", "σ_a", "v̄", "P_d", "λ_f", "λ_b", "p_z", "d̄"):
        assert any(name.endswith(symbol) for name, _, _ in estimate.reasons), symbol
        assert symbol in text


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([], "at least 3 frames"),
        ([[], [], []], "at least 3 frames"),
        ([[[0.0, 0, 0]], [[0.0, 0, 0]]], "at least 3 frames"),
        ([[[0.0, 0, 0]], [], [[0.0, 0, 0]], [], [[0.0, 0, 0]]], "followed from frame to frame"),
        ([[[3.0 * (i % 2), i, 0]] for i in range(9)], "at least 10 links"),
    ],
)
def test_too_little_to_learn_from_is_said(frames, message):
    d = am.Detections.from_frames(np.arange(len(frames)) * 0.1, frames)
    with pytest.raises(am.ParameterError, match=message):
        am.estimate_model(d)


def test_points_that_never_move_and_are_never_missed():
    positions = np.tile(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), (50, 1, 1))
    truth = am.Tracks.from_dense(np.arange(50) * 0.01, positions)
    tracks = am.track(truth.detections)
    assert am.evaluate(tracks, truth).idf1 == 1.0


@pytest.mark.parametrize(
    ("n_frames", "n_markers", "n_empty"), [(20, 300, 0), (5, 6000, 0), (400, 60, 150)]
)
def test_dense_short_and_late_captures(n_frames, n_markers, n_empty):
    rng = np.random.default_rng(6)
    start = rng.uniform(0, 0.1 * n_markers ** (1 / 3), (n_markers, 3))
    t = np.arange(n_frames) * 0.01
    positions = start + 0.05 * np.sin(t[:, None, None] + np.arange(3))
    positions += rng.normal(0, 1e-4, positions.shape)
    positions[:n_empty] = np.nan
    truth = am.Tracks.from_dense(t, positions)
    assert am.evaluate(am.track(truth.detections), truth).idf1 > 0.95


def test_every_other_frame_empty():
    t = np.arange(120) * 0.01
    positions = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)[:, None] + np.zeros((1, 4, 1))
    positions = positions + 2.0 * np.arange(4)[:, None]
    positions[1::2] = np.nan
    truth = am.Tracks.from_dense(t, positions)
    assert am.evaluate(am.track(truth.detections), truth).idf1 > 0.95


def test_one_marker_in_the_plane():
    t = np.arange(100) * 0.02
    positions = np.stack([np.cos(t), np.sin(t)], axis=1)[:, None]
    truth = am.Tracks.from_dense(t, positions)
    assert am.evaluate(am.track(truth.detections), truth).idf1 == 1.0


def test_bursts_of_missed_detections_are_distinguished_from_single_ones():
    seed = 1
    quiet = am.simulate.SCENES["person"].make(activity="walk", frames=160, seed=seed)
    runs = {"missing": 0.15, "missing_run": 4.0, "noise": 3e-4, "clutter": 0.1, "seed": seed}
    d = am.simulate.corrupt(quiet, **runs).detections
    found = am.estimate_model(d, misses="bursts")
    sensor, stds = found.model.sensor, found.stds
    P_d = 1 - 0.15 / 0.85 / 4
    assert abs(sensor.p_detection - P_d) < 4 * stds["p_detection"]
    assert abs(sensor.p_redetection - 0.25) < 4 * stds["p_redetection"]
    assert stds["p_redetection"] < 0.03
    assert "redetection P_r" in str(found)
    # Asked for one rate, it is the share of the frames; and single misses make no runs.
    one = am.estimate_model(d).model.sensor
    assert one.p_redetection is None
    assert one.p_detection == pytest.approx(0.85, abs=0.02)
    single = am.simulate.corrupt(quiet, **runs | {"missing_run": 0.0}).detections
    found = am.estimate_model(single, misses="bursts")
    assert found.model.sensor.p_redetection is None
    assert "no more bursts of missed detections than by chance" in str(found)
    assert found.model == am.estimate_model(single).model


def tracks_of(frames: list[list[tuple[float, int]]]) -> am.Tracks:
    """Points on a line, each with its label."""
    d = am.Detections.from_frames(
        np.arange(len(frames)) * 0.1,
        [np.array([[x, 0.0, 0.0] for x, _ in f]).reshape(-1, 3) for f in frames],
    )
    return am.Tracks(detections=d, labels=np.array([k for f in frames for _, k in f]))


def test_a_marker_that_was_lost_was_not_missed():
    moving = [[(0.1 * t, 0)] for t in range(12)]
    occluded = [f if t not in (4, 5, 6, 9) else [] for t, f in enumerate(moving)]
    assert count_sightings(tracks_of(occluded), 0.05) == Sightings(7 - 2, 2, 2, 2)
    # What is there, near where it is expected, in no track: lost.
    lost = [[(0.1 * t + 0.03, -1)] if t in (4, 5, 6) else f for t, f in enumerate(occluded)]
    assert count_sightings(tracks_of(lost), 0.05) == Sightings(7 - 1, 1, 1, 0)
    far = [[(0.1 * t + 0.07, -1)] if t in (4, 5, 6) else f for t, f in enumerate(occluded)]
    assert count_sightings(tracks_of(far), 0.05) == Sightings(7 - 2, 2, 2, 2)
    # In a track that begins within the gap and goes on: lost. In one that was there: occluded.
    begun = [
        [*f, (0.1 * t + (0.03 if t < 7 else 0.5), 1)] if t >= 4 else f
        for t, f in enumerate(occluded)
    ]
    assert count_sightings(tracks_of(begun), 0.05).misses == 1
    old = [[*f, (0.1 * t + (0.03 if t in (4, 5, 6) else 0.5), 1)] for t, f in enumerate(occluded)]
    assert count_sightings(tracks_of(old), 0.05).misses == 2
    # The same seen backwards: a track that ends within the gap, near where the marker comes from.
    ended = [
        [*f, (0.1 * t + (0.5 if t < 4 else 0.03 if t == 6 else 0.3), 1)] if t < 7 else f
        for t, f in enumerate(occluded)
    ]
    assert count_sightings(tracks_of(ended), 0.05).misses == 1
