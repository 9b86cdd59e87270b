"""The motion of markers on bodies, fitted to tracks that bonds hold together."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from asterism.model import DWNA, InteractingMotions
from asterism.tracking.estimation.estimate import MIN_NOISE, WIDER
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.motion_fit import FitBounds, fit_motion
from asterism.tracking.methods.associate import associate
from asterism.tracking.methods.options import Rigidity
from asterism.tracking.methods.smp import SMP

if TYPE_CHECKING:
    from asterism.model import Detections, TrackingModel, Tracks

__all__ = ["fit_body_motion"]

BETWEEN = 10.0
"""Ratio of the strongest to the weakest motion at the start, where a model has one motion."""


def fit_body_motion(
    detections: Detections, model: TrackingModel
) -> tuple[TrackingModel, Tracks] | None:
    """Fit noise and motion of a model to tracks of markers on bodies, by `SMP` with `Rigidity`.

    `estimate_model` admits no acceleration by which a marker could reach its neighbour, because it
    could not tell it from a wrong link, and explains faster motion as noise. Bonds between markers
    tell them apart, so that there is no such bound here. `SMP` considers three frames: in tracks of
    single frames so many links of fast markers are wrong that the fitted motion grows with each
    fit.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel
        Estimated model.

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
    fit = _start(model)
    if fit is None:
        return None
    levels = (*fit.levels[:-1], WIDER * fit.levels[-1])
    n_axes = detections.n_axes
    wide = _with(model, dataclasses.replace(fit, noise=MIN_NOISE, levels=levels), n_axes)
    bounds = FitBounds(min_noise=MIN_NOISE, max_acceleration=math.inf)
    method = SMP(window=3, rigid=Rigidity())
    rough = associate(method, detections, wide, score=False)
    fit = fit_motion(rough, wide, fit, bounds, refine=True)
    fitted = _with(model, fit, n_axes)
    tracks = associate(method, detections, fitted, score=False)
    fit = fit_motion(tracks, fitted, fit, bounds, refine=True)
    return _with(model, fit, n_axes), tracks


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
    sensor = dataclasses.replace(model.sensor, noise_sigma=fit.noise)
    return dataclasses.replace(model, motion=fit.motion(velocity), sensor=sensor)
