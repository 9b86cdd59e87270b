"""The likelihood of a motion is that of the filter, whatever is missed and however times differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from asterism.tracking.estimation.likelihood import TrackLikelihood
from asterism.tracking.estimation.motion_fit import MotionFit
from tests.scenes import small_model, wanderers

FITS = {
    "one motion": MotionFit(noise=0.004, levels=(1.2,)),
    "random walk": MotionFit(noise=0.006, levels=(0.3,), kind="random_walk"),
    "three motions": MotionFit(noise=0.005, levels=(0.4, 2.0, 40.0), stay=0.93),
    "hardly any noise": MotionFit(noise=1e-6, levels=(0.01, 2.0, 40.0), stay=0.5),
}


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
    tracked = truth.detections.n_points - (truth.labels < 0).sum()
    model = small_model(motion=fit.motion(0.8), noise_sigma=fit.noise)
    densities = am.filter.filter_states(truth, model).log_densities
    mean = TrackLikelihood([truth], 0.8, 10**6).mean(fit)
    assert mean == pytest.approx(densities.sum() / tracked, rel=1e-9)


def test_a_capture_too_large_is_sampled_in_pieces():
    truth = wanderers(np.random.default_rng(1), n_markers=30, n_frames=600)
    likelihood = TrackLikelihood([truth], 0.8, 4000)
    assert 3000 < likelihood.n_points < 5000
    assert 0.9 < likelihood.n_links / likelihood.n_points < 1
    whole = am.filter.filter_states(
        truth, small_model(motion=FITS["one motion"].motion(0.8), noise_sigma=0.004)
    ).log_densities
    assert likelihood.mean(FITS["one motion"]) == pytest.approx(whole[whole != 0].mean(), rel=0.05)
