"""Choice of a method without the motion that most markers have in common."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model.posterior import track_scores
from asterism.tracking.choose import Choice, choose_method, quick_tracks
from asterism.tracking.estimation import estimate_model, without_common_motion
from asterism.tracking.rigidity.distances import MIN_TOGETHER

if TYPE_CHECKING:
    from asterism.model import Detections, TrackingModel, Tracks

__all__ = ["choice_without_common_motion"]

COST = 0.5
"""Cost of a coordinate or an angle of a motion in common, in the logarithm of the number of
detections of a frame (BIC), nats."""
MAX_COMPARED = 20_000
"""Number of detections at the beginning of a capture that show whether there is one."""


def choice_without_common_motion(
    detections: Detections, model: TrackingModel | None
) -> Choice | None:
    """Return the choice without the motion in common, or None where that motion stays.

    With a model, the detections must be more probable without the motion by more than it costs:
    half the logarithm of the number of detections of a frame for each of its coordinates and
    angles (BIC). Without one nothing is compared.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel or None
        Its model; None if none can be estimated.

    Returns
    -------
    Choice or None
        With the estimate of the model for the rest of the motion; None also if none can be
        estimated.
    """
    if model is None:
        why = "with it, no marker is nearer to its next position than to others"
    elif gain := _gain_without(detections, model):
        why = f"its removal raises the log density by {gain:.2g} nats per detection"
    else:
        return None
    still = without_common_motion(detections)
    try:
        estimate = estimate_model(still)
    except ParameterError:
        return None
    choice = choose_method(still, estimate.model)
    reason = f"without the motion that most markers have in common ({why}), {choice.reason}"
    return replace(choice, reason=reason, estimate=estimate, common_motion=True)


def _gain_without(detections: Detections, model: TrackingModel) -> float:
    """Return the gain in log density per detection without the motion in common; 0 for none."""
    n_frames = detections.n_frames * MAX_COMPARED // max(detections.n_points, 1)
    part = detections.part(0, min(max(n_frames, MIN_TOGETHER), detections.n_frames)).measured()
    still = without_common_motion(part)
    try:
        model_of_rest = estimate_model(still).model
    except ParameterError:
        return 0.0
    found = quick_tracks(still, model_of_rest)[0]
    gain = _log_density(found, model_of_rest) - _log_density(quick_tracks(part, model)[0], model)
    D, T = part.n_axes, part.n_frames
    cost = T * D * (D + 1) / 2 * COST * math.log(max(part.n_points / T, 1))
    return gain / part.n_points if gain > cost else 0.0


def _log_density(tracks: Tracks, model: TrackingModel) -> float:
    """Return the log density of all detections, those without a track as clutter."""
    scores = track_scores(tracks, model)
    clutter = len(tracks.labels) * math.log(model.sensor.clutter_density)
    return float(scores[np.isfinite(scores)].sum()) + clutter
