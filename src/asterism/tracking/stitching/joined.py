"""Joins of the tracks that stitching leaves apart, by the distances that both keep."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Tracks
from asterism.tracking.stitching.agreement import agreeing
from asterism.tracking.stitching.returned import STEADY, returned

if TYPE_CHECKING:
    from asterism.model import Detections
    from asterism.tracking.stitching.passes import Pass

__all__ = ["joined_by_distances"]

AGREEING = 0.95
"""Probability of a join by equal distances, as measured on simulated people."""


def joined_by_distances(
    detections: Detections, found: Pass, noise_sigma: float, max_occlusion: int | None
) -> Pass:
    """Join tracks that keep the same distances, to others or as bodies among themselves.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    found : Pass
        Result of the last pass.
    noise_sigma, max_occlusion
        As for `returned`.

    Returns
    -------
    Pass
        The same tracklets, of fewer markers.
    """
    markers, after, probabilities = (
        each.copy() for each in (found.markers, found.after, found.probabilities)
    )
    within, between = (partial(returned, steady=each) for each in STEADY)
    for find in (agreeing, within, agreeing, between, agreeing):
        # The last element is the label of clutter.
        labels = np.append(np.maximum(markers, -1), -1).astype(np.int64)[found.tracklets]
        tracks = Tracks(detections=detections, labels=labels)
        for earlier, later in find(tracks, noise_sigma, max_occlusion):
            markers[markers == later] = earlier
            own = np.flatnonzero(markers == earlier)  # tracklets are numbered by their start
            is_new = after[own[1:]] != own[:-1]
            after[own[1:]] = own[:-1]
            probabilities[own[1:][is_new]] = AGREEING
    used, numbers = np.unique(markers[markers >= 0], return_inverse=True)
    if len(used) <= markers.max(initial=-1):
        markers[markers >= 0] = numbers
    return replace(found, markers=markers, after=after, probabilities=probabilities)
