"""Noise and motion of a model, fitted to given tracks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.model import DWNA, InteractingMotions
from asterism.tracking.estimation.estimate import MIN_NOISE
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.motion_fit import FitBounds, fit_motion

if TYPE_CHECKING:
    from asterism.model import Recipe, TrackingModel, Tracks

__all__ = ["BOUNDS", "fit_to_capture", "fit_to_tracks", "model_of", "start_of", "with_fit"]

BETWEEN = 10.0
"""Ratio of the strongest to the weakest motion at the start, where a model has one motion."""
FASTER = 3.0
"""Largest speed of a marker, in the root mean square of all."""
BOUNDS = FitBounds(min_noise=MIN_NOISE, max_acceleration=math.inf)


def fit_to_tracks(tracks: Tracks, model: TrackingModel) -> TrackingModel:
    """Fit noise and motion of a model to tracks whose links are right for the most part.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    model : TrackingModel
        Model with one DWNA or three, from which the search starts.

    Returns
    -------
    TrackingModel
        Model with three motions.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=100, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> len(fit_to_tracks(truth, model).motion.models)
    3
    """
    start = start_of(model)
    assert start is not None
    fit = fit_motion(tracks, model, start, BOUNDS, refine=True)
    return with_fit(model, fit, tracks.detections.n_axes)


def fit_to_capture(tracks: Tracks, model: TrackingModel) -> TrackingModel:
    """Fit noise and motion to tracks of a capture for which the model does not hold.

    Parameters
    ----------
    tracks : Tracks
        Tracks in the coordinates of the capture.
    model : TrackingModel
        Model of other coordinates, as of `without_common_motion`, with the same noise.

    Returns
    -------
    TrackingModel
        Model with three motions, whose search starts from the velocities and accelerations of the
        tracks; `model` itself where no track has three detections in a row.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=100, seed=1)
    >>> model = am.estimate_model(am.tracking.without_common_motion(truth.detections)).model
    >>> len(fit_to_capture(truth, model).motion.models)
    3
    """
    d = tracks.detections
    order, _ = tracks.by_track
    frame, track = d.frame_of[order], tracks.labels[order]
    last = np.flatnonzero((track[2:] == track[:-2]) & (frame[2:] - frame[:-2] == 2)) + 2
    if not len(last):
        return model
    steps = np.diff(d.times)
    now, before = steps[frame[last] - 1][:, None], steps[frame[last] - 2][:, None]
    y = d.points[order]
    velocity = (y[last] - y[last - 1]) / now
    acceleration = 2 * (velocity - (y[last - 1] - y[last - 2]) / before) / (now + before)
    strongest = float(np.sqrt((acceleration**2).mean()))
    speed = float(np.sqrt((velocity**2).sum(axis=1).mean()))
    if not strongest > 0:
        return model
    population = replace(
        model.population, max_speed=max(model.population.max_speed, FASTER * speed)
    )
    model = replace(model, population=population)
    levels = (strongest / BETWEEN, strongest / math.sqrt(BETWEEN), strongest)
    start = MotionFit(noise=model.sensor.noise_sigma, levels=levels, stay=0.95)
    return with_fit(model, fit_motion(tracks, model, start, BOUNDS, refine=True), d.n_axes)


def model_of(tracks: Tracks, recipe: Recipe) -> TrackingModel:
    """Return the model that holds for tracks in the coordinates of their capture.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a recipe.
    recipe : Recipe
        Recipe, whose model may be that of the capture without its common motion.
    """
    return fit_to_capture(tracks, recipe.model) if recipe.common_motion else recipe.model


def start_of(model: TrackingModel) -> MotionFit | None:
    """Return noise and three motions of a model, from which a search starts; None for random walks.

    Parameters
    ----------
    model : TrackingModel
        Model with one DWNA or three.
    """
    motion = model.motion
    motions = motion.models if isinstance(motion, InteractingMotions) else (motion,)
    levels = [each.acceleration_sigma for each in motions if isinstance(each, DWNA)]
    if len(levels) != len(motions):
        return None
    if len(levels) == 1:
        levels = [levels[0] / BETWEEN, levels[0] / math.sqrt(BETWEEN), levels[0]]
    return MotionFit(noise=model.sensor.noise_sigma, levels=tuple(levels), stay=0.95)


def with_fit(model: TrackingModel, fit: MotionFit, n_axes: int) -> TrackingModel:
    """Return a model with fitted noise and motion.

    Parameters
    ----------
    model : TrackingModel
        Model for all else.
    fit : MotionFit
        Noise and motion.
    n_axes : int
        Number of coordinates.
    """
    velocity = model.velocity_sigma(n_axes)
    sensor = replace(model.sensor, noise_sigma=fit.noise)
    return replace(model, motion=fit.motion(velocity), sensor=sensor)
