"""Tracklets: short tracks that are terminated early, so that each belongs to one marker."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asterism.model import TrackingModel

__all__ = ["MAX_TRACKLET_GAP", "tracklet_model"]

MAX_TRACKLET_GAP = 4
"""Tracklets are terminated after four missed frames: the neighbours of a marker predict better than
its own motion where it reappears."""


def tracklet_model(model: TrackingModel) -> TrackingModel:
    """Return a copy of the model with `max_gap` limited to `MAX_TRACKLET_GAP` frames.

    Parameters
    ----------
    model : TrackingModel
        Tracking model of the capture.

    Returns
    -------
    TrackingModel
        Model for the tracklets that `stitch` expects; other values are unchanged.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> model.population.max_gap, am.tracking.tracklet_model(model).population.max_gap
    (28, 4)
    """
    max_gap = min(model.population.max_gap, MAX_TRACKLET_GAP)
    return dataclasses.replace(
        model, population=dataclasses.replace(model.population, max_gap=max_gap)
    )
