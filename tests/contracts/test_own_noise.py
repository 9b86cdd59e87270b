"""Detections with noise of their own, as several cameras tell it, beyond the sensor's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from tests.contracts.methods import each_method
from tests.references.filters import kalman
from tests.references.posterior import track_score
from tests.scenes import interacting, small_model, wanderers

SIGMA = 0.005


def with_variances(truth: am.Tracks, variances) -> am.Tracks:
    d = truth.detections
    own = np.broadcast_to(variances, d.n_points)[:, None, None] * np.eye(d.n_axes)
    return dataclasses.replace(truth, detections=dataclasses.replace(d, covariances=own))


@pytest.mark.parametrize("n_axes", [2, 3])
def test_scores_and_states_are_those_of_the_textbook(n_axes):
    rng = np.random.default_rng(0)
    truth = wanderers(rng, missing=0.2, n_axes=n_axes, irregular=True)
    extra = rng.uniform(0, 4 * SIGMA**2, truth.detections.n_points)
    extra[::3] = 0
    noisy, model = with_variances(truth, extra), small_model()
    d, (order, offsets) = truth.detections, truth.by_track
    scores, states = am.model.track_scores(noisy, model), am.filter.filter_states(noisy, model)
    for k in range(truth.n_tracks):
        own = order[offsets[k] : offsets[k + 1]]
        frames, points = d.frame_of[own], d.points[own]
        means, P, _, _, densities = kalman(model, d.times, frames, points, extra[own])
        assert np.allclose(states.log_densities[own], densities, rtol=1e-9)
        assert scores[k] == pytest.approx(
            track_score(model, d.times, frames, points, densities), rel=1e-9
        )
        rows = slice(states.offsets[k], states.offsets[k + 1])
        assert np.allclose(states.means[rows].reshape(len(means), -1), means, atol=1e-12)
        n = states.covariances.shape[1]
        assert np.allclose(states.covariances[rows], np.array(P)[:, :n, :n], rtol=1e-7)
    assert not np.allclose(scores, am.model.track_scores(truth, model))


def split_in_two(model: am.TrackingModel, share: float) -> tuple[am.TrackingModel, float]:
    """The model with a share of the noise variance, and the rest for the detections."""
    sigma = model.sensor.noise_sigma
    sensor = dataclasses.replace(model.sensor, noise_sigma=sigma * share**0.5)
    return dataclasses.replace(model, sensor=sensor), (1 - share) * sigma**2


@each_method
@pytest.mark.parametrize("motion", ["dwna", "interacting"])
def test_noise_is_the_same_wherever_it_is_said_to_come_from(method, motion):
    # Half of it the sensor's and half the detections', or all of it the sensor's.
    truth = wanderers(np.random.default_rng(1), missing=0.15, clutter=1.5)
    model = small_model(max_speed=20.0)
    if motion == "interacting":
        model = dataclasses.replace(model, motion=interacting())
    halved, rest = split_in_two(model, 0.5)
    noisy = with_variances(truth, rest)
    a = am.track(truth.detections, method, model=model, seed=1)
    b = am.track(noisy.detections, method, model=halved, seed=1)
    assert np.array_equal(a.labels, b.labels)
    assert b.info["log_posterior"] == pytest.approx(a.info["log_posterior"], rel=1e-9)
    if a.confidence is not None:
        assert np.allclose(a.confidence, b.confidence, atol=1e-6)
    assert b.info["isotropic_noise"]
    assert "isotropic_noise" not in a.info


@each_method
def test_frame_by_frame_is_the_whole(method):
    rng = np.random.default_rng(2)
    truth = wanderers(rng, n_frames=20)
    noisy = with_variances(truth, rng.uniform(0, 9 * SIGMA**2, truth.detections.n_points))
    d, model = noisy.detections, small_model()
    state = method.init(model, seed=1)
    labels = np.full(d.n_points, -1)
    for t, (time, points) in enumerate(d):
        frame = slice(d.offsets[t], d.offsets[t + 1])
        state, update = method.step(state, time, points, covariances=d.covariances[frame])
        labels[frame] = update.labels
        labels[update.revised] = update.revised_labels
    assert np.array_equal(labels, am.track(d, method, model=model, seed=1).labels)


@pytest.mark.parametrize("method", [am.GNN(), am.SMP(window=3), am.MCMCDA()], ids=str)
def test_knowing_which_detections_are_blurred_helps(method):
    # Every other detection is ten times as blurred, which no one sensor's noise describes.
    rng = np.random.default_rng(3)
    truth = wanderers(rng, n_markers=120, n_frames=40, missing=0.05, clutter=40.0)
    d = truth.detections
    is_blurred = rng.random(d.n_points) < 0.5
    points = d.points + np.where(is_blurred, 0.05, 0.0)[:, None] * rng.normal(size=d.points.shape)
    blurred = dataclasses.replace(truth, detections=dataclasses.replace(d, points=points))
    known = with_variances(blurred, np.where(is_blurred, 0.05**2, 0.0))
    model = small_model(max_speed=20.0, p_redetection=None)
    usual = dataclasses.replace(
        model, sensor=dataclasses.replace(model.sensor, noise_sigma=np.hypot(SIGMA, 0.05 / 2**0.5))
    )
    with_it = am.evaluate(am.track(known.detections, method, model=model, seed=1), known)
    without = am.evaluate(am.track(blurred.detections, method, model=usual, seed=1), blurred)
    assert 1 - with_it.idf1 < 0.8 * (1 - without.idf1)


def test_the_model_of_a_capture_leaves_to_points_their_own_noise():
    rng = np.random.default_rng(4)
    truth = wanderers(rng, n_markers=12, n_frames=250)
    d = truth.detections
    own = np.where(rng.random(d.n_points) < 0.5, 0.02, 0.0)
    points = d.points + own[:, None] * rng.normal(size=d.points.shape)
    blurred = dataclasses.replace(truth, detections=dataclasses.replace(d, points=points))
    known = with_variances(blurred, own**2)
    sigma = am.estimate_model(known.detections).model.sensor.noise_sigma
    assert 0.8 < sigma / SIGMA < 1.25  # as where all are alike (test_estimate)
    assert am.estimate_model(blurred.detections).model.sensor.noise_sigma > 2 * SIGMA


@pytest.mark.parametrize(
    ("covariances", "message"),
    [
        (np.zeros((1, 3, 3)), "covariances"),
        (np.full((2, 3, 3), np.nan), "covariances"),
        (np.stack([np.eye(3), -np.eye(3)]), "negative"),
        ([0.1, 0.2], "covariances"),
    ],
)
def test_covariances_that_are_none_are_told(covariances, message):
    method = am.GNN()
    state = method.init(small_model())
    with pytest.raises(am.ParameterError, match=message):
        method.step(state, 0.0, np.zeros((2, 3)), covariances=covariances)


def test_a_part_keeps_what_is_known_of_its_points():
    d = with_variances(wanderers(np.random.default_rng(5)), 1e-6).detections
    part = d.part(3, 9)
    assert np.array_equal(part.times, d.times[3:9])
    assert np.array_equal(part.points, d.points[d.offsets[3] : d.offsets[9]])
    assert part.covariances is not None
    assert len(part.covariances) == part.n_points


def test_a_part_of_a_capture_is_detections(tmp_path):
    am.write(wanderers(np.random.default_rng(6)), tmp_path / "a.c3d")
    capture = am.read(tmp_path / "a.c3d")
    part = capture.part(2, 4)
    assert type(part) is am.Detections
    assert np.array_equal(part.points, capture.points[capture.offsets[2] : capture.offsets[4]])


def test_a_capture_too_long_to_be_read_whole_is_read_in_pieces(tmp_path):
    rng = np.random.default_rng(7)
    paths = rng.uniform(-1, 1, (1, 40, 3)) + 0.1 * np.sin(np.arange(1800)[:, None, None] / 30)
    paths = paths + rng.normal(0, 1e-3, paths.shape)
    am.write(am.Tracks.from_dense(np.arange(1800) * 0.01, paths), tmp_path / "a.c3d")
    capture = am.read(tmp_path / "a.c3d")
    assert capture.n_points > 60_000
    bare = am.Detections(times=capture.times, offsets=capture.offsets, points=capture.points)
    assert am.estimate_model(capture).model == am.estimate_model(bare).model
