"""The motion of markers on bodies, fitted to tracks that bonds hold together."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.model import DWNA, InteractingMotions
from asterism.tracking.estimation.estimate import MIN_NOISE, WIDER
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.motion_fit import FitBounds, fit_motion
from asterism.tracking.methods.associate import associate
from asterism.tracking.methods.options import Rigidity
from asterism.tracking.methods.smp import SMP

if TYPE_CHECKING:
    from asterism.model import Detections, TrackingModel, Tracks
    from asterism.tracking.methods.base import Method

__all__ = ["OVER_THREE_FRAMES", "fit_body_motion", "fit_to_capture", "fit_to_tracks"]

BETWEEN = 10.0
"""Ratio of the strongest to the weakest motion at the start, where a model has one motion."""
FASTER = 3.0
"""Largest speed of a marker, in the root mean square of all."""
BOUNDS = FitBounds(min_noise=MIN_NOISE, max_acceleration=math.inf)
OVER_THREE_FRAMES = SMP(window=3, rigid=Rigidity())
"""Method by whose tracks the motion is fitted by default."""


def fit_body_motion(
    detections: Detections, model: TrackingModel, method: Method[Any] = OVER_THREE_FRAMES
) -> tuple[TrackingModel, Tracks] | None:
    """Fit noise and motion of a model to tracks of markers on bodies, by a method with `Rigidity`.

    `estimate_model` admits no acceleration by which a marker could reach its neighbour, because it
    could not tell it from a wrong link, and explains faster motion as noise. Bonds between markers
    tell them apart, so that there is no such bound here. The default is `SMP` over three frames: by
    single frames, so many links of fast markers are wrong that the fitted motion grows with each
    fit.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel
        Estimated model.
    method : Method
        Method with bonds.

    Returns
    -------
    model : TrackingModel
        Model with three motions.
    tracks : Tracks
        Tracks to which it was fitted.

    If the markers move in random walks, the result is None.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.tracking.estimation import fit_body_motion
    >>> truth = am.simulate.person(frames=100, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> fitted, tracks = fit_body_motion(truth.detections, model)
    >>> len(fitted.motion.models), tracks.n_tracks
    (3, 53)
    """
    start = _start(model)
    if start is None:
        return None
    n_axes = detections.n_axes
    levels = (*start.levels[:-1], WIDER * start.levels[-1])
    wide = _with(model, replace(start, noise=MIN_NOISE, levels=levels), n_axes)
    rough = associate(method, detections, wide, score=False)
    fit = fit_motion(rough, model, start, BOUNDS, refine=True)
    tracks = associate(method, detections, _with(model, fit, n_axes), score=False)
    return _with(model, fit_motion(tracks, model, fit, BOUNDS, refine=True), n_axes), tracks


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
    start = _start(model)
    assert start is not None
    fit = fit_motion(tracks, model, start, BOUNDS, refine=True)
    return _with(model, fit, tracks.detections.n_axes)


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
    return _with(model, fit_motion(tracks, model, start, BOUNDS, refine=True), d.n_axes)


def _start(model: TrackingModel) -> MotionFit | None:
    motion = model.motion
    motions = motion.models if isinstance(motion, InteractingMotions) else (motion,)
    levels = [each.acceleration_sigma for each in motions if isinstance(each, DWNA)]
    if len(levels) != len(motions):
        return None
    if len(levels) == 1:
        levels = [levels[0] / BETWEEN, levels[0] / math.sqrt(BETWEEN), levels[0]]
    return MotionFit(noise=model.sensor.noise_sigma, levels=tuple(levels), stay=0.95)


def _with(model: TrackingModel, fit: MotionFit, n_axes: int) -> TrackingModel:
    velocity = model.velocity_sigma(n_axes)
    sensor = replace(model.sensor, noise_sigma=fit.noise)
    return replace(model, motion=fit.motion(velocity), sensor=sensor)
