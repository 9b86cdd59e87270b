"""Motion of markers on bodies, fitted to tracks that bonds hold together."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import asterism as am
from asterism.tracking.estimation import fit_body_motion, fit_to_tracks
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.motion_fit import FitBounds, fit_motion


@pytest.mark.parametrize(("stride", "seed"), [(2, 11), (4, 11), (4, 15)])
def test_the_motion_of_a_runner_is_that_of_the_true_tracks(stride, seed):
    run = am.simulate.person(activity="run", frames=600, seed=seed)
    truth = am.simulate.corrupt(run, missing=0.1, clutter=0.1, noise=3e-4, stride=stride, seed=seed)
    model = am.estimate_model(truth.detections).model
    fitted, tracks = fit_body_motion(truth.detections, model)
    start = MotionFit(noise=3e-4, levels=(5.0, 20.0, 100.0), stay=0.95)
    bounds = FitBounds(min_noise=2e-4, max_acceleration=math.inf)
    true = fit_motion(truth, model, start, bounds, refine=True)
    levels = [each.acceleration_sigma for each in fitted.motion.models]
    for level, wanted in zip(levels, true.levels, strict=True):
        assert wanted / 2 < level < 2 * wanted
    assert fitted.sensor.noise_sigma < 1e-3 < model.sensor.noise_sigma
    assert am.evaluate(tracks, truth).idf1 > 0.75


def test_random_walks_have_no_such_motion():
    walkers = am.simulate.corrupt(
        am.simulate.SCENES["walk"].make(seed=1), missing=0.1, clutter=0.1, noise=0.005, seed=1
    )
    d = walkers.detections
    assert fit_body_motion(d, am.estimate_model(d).model) is None


def test_the_noise_of_tracks_is_found_from_a_model_that_has_more():
    walk = am.simulate.person(activity="walk", frames=200, seed=3)
    truth = am.simulate.corrupt(walk, noise=5e-4, seed=3)
    model = am.estimate_model(truth.detections).model
    sensor = dataclasses.replace(model.sensor, noise_sigma=4 * model.sensor.noise_sigma)
    fitted = fit_to_tracks(truth, dataclasses.replace(model, sensor=sensor))
    assert abs(fitted.sensor.noise_sigma - 5e-4) < 5e-5


def test_tracks_without_a_motion_give_none():
    model = am.estimate_model(am.simulate.person(frames=60, seed=1).detections).model
    rng = np.random.default_rng(1)
    d = am.Detections.from_frames([0.0, 0.01], list(rng.uniform(-100, 100, (2, 5, 3))))
    assert fit_body_motion(d, model) is None
