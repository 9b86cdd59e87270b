"""The likelihood of a motion is that of the filter, whatever is missed and however times differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.likelihood import TrackLikelihood
from asterism.tracking.estimation.quasi_newton import maximise
from tests.scenes import small_model, wanderers

FITS = {
    "one motion": MotionFit(noise=0.004, levels=(1.2,)),
    "random walk": MotionFit(noise=0.006, levels=(0.3,), kind="random_walk"),
    "three motions": MotionFit(noise=0.005, levels=(0.4, 2.0, 40.0), stay=0.93),
    "hardly any noise": MotionFit(noise=1e-6, levels=(0.01, 2.0, 40.0), stay=0.5),
}


def log_likelihoods(likelihood, *fits):
    return likelihood.sums(
        [fit.noise for fit in fits],
        [fit.levels for fit in fits],
        [fit.stay for fit in fits],
        fits[0].kind,
    )


@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("own_noise", [False, True])
def test_the_likelihood_is_that_of_the_filter(fit, n_axes, own_noise):
    rng = np.random.default_rng(5)
    truth = wanderers(rng, n_axes=n_axes, missing=0.3, clutter=1, irregular=True)
    if own_noise:
        sigma = rng.uniform(0, 0.02, truth.detections.n_points)
        spread = sigma[:, None, None] ** 2 * np.eye(n_axes)
        truth = replace(truth, detections=replace(truth.detections, covariances=spread))
    model = small_model(motion=fit.motion(0.8), noise_sigma=fit.noise)
    densities = am.filter.filter_states(truth, model).log_densities
    found = log_likelihoods(TrackLikelihood(truth, 0.8, 10**6), fit, fit)
    assert found == pytest.approx([densities.sum()] * 2, rel=1e-9)


def test_a_capture_too_large_is_sampled_in_pieces():
    truth = wanderers(np.random.default_rng(1), n_markers=30, n_frames=600)
    likelihood = TrackLikelihood(truth, 0.8, 4000)
    assert 3000 < likelihood.n_points < 5000
    assert 0.9 < likelihood.n_links / likelihood.n_points < 1
    whole = am.filter.filter_states(
        truth, small_model(motion=FITS["one motion"].motion(0.8), noise_sigma=0.004)
    ).log_densities
    mean = log_likelihoods(likelihood, FITS["one motion"])[0] / likelihood.n_points
    assert mean == pytest.approx(whole[whole != 0].mean(), rel=0.05)


def test_a_numerical_failure_is_not_a_number():
    truth = wanderers(np.random.default_rng(5))
    likelihood = TrackLikelihood(truth, 0.8, 10**6)
    for fit in FITS.values():
        assert np.isnan(log_likelihoods(likelihood, replace(fit, noise=np.nan))[0])


@pytest.mark.parametrize("seed", range(5))
def test_the_maximum_is_found_in_a_box(seed):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(4, 4))
    information = 30 * half @ half.T + 5 * np.eye(4)
    peak = rng.normal(size=4)

    def log_likelihoods(points):
        return [-0.5 * (x - peak) @ information @ (x - peak) for x in points]

    wide = np.full(4, np.inf)
    # The expected gain that ends the search is that of an approximate curvature.
    assert maximise(log_likelihoods, np.zeros(4), -wide, wide)[1] > -1
    high = peak - np.array([0.5, -5.0, -5.0, -5.0])
    bound, value = maximise(log_likelihoods, np.zeros(4), -wide, high)
    assert bound[0] == high[0]
    # The maximum on the face of the box: the others given the first.
    others = peak[1:] + np.linalg.solve(information[1:, 1:], information[1:, 0]) * 0.5
    expected = np.concatenate([[high[0]], others])
    if (others < high[1:]).all():
        assert value > log_likelihoods([expected])[0] - 1
