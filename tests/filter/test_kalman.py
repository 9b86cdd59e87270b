from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from tests.references.filters import imm_log_densities, kalman, rts
from tests.scenes import interacting, small_model, wanderers

MOTIONS = {
    "dwna": am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.8),
    "random walk": am.RandomWalk(walk_sigma=0.3),
    "dwpa": am.DWPA(increment_sigma=1.0, acceleration_prior_sigma=3.0),
}


def tracks_of(truth: am.Tracks):
    d = truth.detections
    order, offsets = truth.by_track
    for k in range(truth.n_tracks):
        members = order[offsets[k] : offsets[k + 1]]
        if len(members):
            yield k, d.frame_of[members], d.points[members], members


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_filter_and_smoother_are_the_textbook_ones(motion, n_axes):
    truth = wanderers(np.random.default_rng(1), n_axes=n_axes, missing=0.3, irregular=True)
    model = small_model(motion=motion)
    filtered, smoothed = (
        am.filter.filter_states(truth, model),
        am.filter.smooth_states(truth, model),
    )
    times = truth.detections.times
    for k, frames, points, members in tracks_of(truth):
        means, covariances, predicted, transitions, densities = kalman(model, times, frames, points)
        xs, Ps = rts(means, covariances, predicted, transitions)
        rows = slice(filtered.offsets[k], filtered.offsets[k + 1])
        n = filtered.means.shape[2]
        assert filtered.first_frames[k] == frames[0]
        assert np.allclose(filtered.means[rows].reshape(-1, n_axes * n), means, rtol=1e-9)
        assert np.allclose(filtered.covariances[rows], [P[:n, :n] for P in covariances], rtol=1e-8)
        assert np.allclose(filtered.log_densities[members], densities, rtol=1e-9, atol=1e-9)
        assert np.allclose(smoothed.means[rows].reshape(-1, n_axes * n), xs, rtol=1e-6, atol=1e-9)
        assert np.allclose(smoothed.covariances[rows], [P[:n, :n] for P in Ps], rtol=1e-6)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_interacting_motions_are_weighed_as_by_the_plain_formulas(n_axes):
    truth = wanderers(np.random.default_rng(2), n_axes=n_axes, missing=0.2, irregular=True)
    model = small_model(motion=interacting())
    states = am.filter.filter_states(truth, model)
    for _, frames, points, members in tracks_of(truth):
        expected = imm_log_densities(model, truth.detections.times, frames, points)
        assert np.allclose(states.log_densities[members], expected, rtol=1e-9, atol=1e-9)


def test_alike_modes_are_one_mode():
    truth = wanderers(np.random.default_rng(3))
    one = am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.8)
    two = am.InteractingMotions(models=(one, one), transitions=[[0.9, 0.1], [0.3, 0.7]])
    a = am.filter.smooth_states(truth, small_model(motion=one))
    b = am.filter.smooth_states(truth, small_model(motion=two))
    assert np.allclose(a.means, b.means, rtol=1e-9, atol=1e-12)
    assert np.allclose(a.covariances, b.covariances, rtol=1e-8)
    assert np.allclose(a.log_densities, b.log_densities, rtol=1e-9, atol=1e-9)


def test_linear_motion_by_its_matrices_is_the_motion_it_describes():
    truth = wanderers(np.random.default_rng(4))
    dwna = am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.8)
    by_matrices = am.model.LinearMotion(
        F=dwna.transition(0.1)[0],
        Q=dwna.process_noise(0.1)[0],
        H=[1.0, 0.0],
        step=0.1,
        prior_covariance=np.diag([0.0, 0.64]),
    )
    a = am.filter.filter_states(truth, small_model(motion=dwna))
    b = am.filter.filter_states(truth, small_model(motion=by_matrices))
    assert np.allclose(a.log_densities, b.log_densities, rtol=1e-9, atol=1e-9)


def test_smoothing_stays_calibrated_and_stable_over_a_long_capture():
    # 20 000 frames of one marker: errors against truth within the stated covariance, none drifting.
    rng = np.random.default_rng(5)
    n, dt, sigma_a, sigma = 20_000, 0.01, 3.0, 0.01
    a = rng.normal(0, sigma_a, (n, 3))
    v = np.cumsum(a * dt, axis=0) - a * dt
    x = np.cumsum(np.vstack([np.zeros(3), (v * dt + a * dt**2 / 2)[:-1]]), axis=0)
    y = x + rng.normal(0, sigma, x.shape)
    tracks = am.Tracks.from_dense(np.arange(n) * dt, y[:, None])
    model = small_model(
        motion=am.DWNA(acceleration_sigma=sigma_a, velocity_sigma=1.0), noise_sigma=sigma
    )
    states = am.filter.smooth_states(tracks, model)
    chi2 = ((states.means[:, :, 0] - x) ** 2 / states.covariances[:, 0, 0, None]).mean()
    # Errors are correlated over some ten frames: about 6000 independent χ²₁ values, of variance 2.
    assert abs(chi2 - 1) < 5 * np.sqrt(2 / 6000)
    assert np.linalg.eigvalsh(states.covariances).min() > 0


def test_empty_tracks_have_no_states():
    detections = am.Detections.from_frames([0.0, 0.1], [[[0, 0, 0]], [[0, 0, 0]]])
    tracks = am.Tracks(detections=detections, labels=[1, 1], names=("gone", "here"))
    states = am.filter.smooth_states(tracks, small_model())
    assert states.offsets.tolist() == [0, 0, 2]
    assert np.isnan(states.positions(2)[:, 0]).all()
    assert np.isfinite(states.positions(2)[:, 1]).all()
