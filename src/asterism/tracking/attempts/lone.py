"""Lone detections that tracks miss in a gap of one frame, taken into these tracks."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.identity import CERTAIN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel
    from asterism.tracking.stitching import Stitching

__all__ = ["with_lone_detections"]

DEGREES = 3.0
"""Degrees of freedom of Student's t, the distribution of a detection around the middle of those
before and after it. Jolts that the motion model excludes are in its tails."""


def with_lone_detections(found: Stitching, model: TrackingModel) -> Stitching:
    """Add lone detections to stitched tracks that have a gap of one frame there.

    Where a marker moves by more than the model admits, its track has such a gap, and its detection
    there belongs to no tracklet. The hypothesis that the detection is of the marker is compared
    with a missed detection and clutter. The scale of its distribution around the middle of the gap
    is the median deviation of all detections that have one in the frame before and after. It is
    added if no other is more probable for the gap, no other gap is more probable for it, and its
    probability exceeds `CERTAIN`, so that the link is no uncertain decision.

    Parameters
    ----------
    found : Stitching
        Stitched tracks.
    model : TrackingModel
        Model with which they were tracked.

    Returns
    -------
    Stitching
        Each such detection is in the tracklet before it. ``tracks.info["lone"]`` is their number.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> d = truth.detections
    >>> model = am.estimate_model(d).model
    >>> labels = truth.labels.copy()
    >>> labels[d.offsets[30]] = -1
    >>> missed = am.Tracks(detections=d, labels=labels)
    >>> with_lone_detections(am.stitch(missed, model), model).tracks.info["lone"]
    1
    """
    tracks, d = found.tracks, found.tracks.detections
    own, _ = tracks.by_track
    frame, track, points = d.frame_of[own], tracks.labels[own], d.points[own]
    # The detections around each detection, and around each gap of one frame.
    around = np.flatnonzero((track[2:] == track[:-2]) & (frame[2:] - frame[:-2] == 2)) + 1
    off = points[around] - (points[around - 1] + points[around + 1]) / 2
    scale2 = np.median((off**2).sum(axis=1)) / d.n_axes if len(off) else 0.0
    gaps = np.flatnonzero((track[1:] == track[:-1]) & (frame[1:] - frame[:-1] == 2))
    middle = (points[gaps] + points[gaps + 1]) / 2
    free = np.flatnonzero(found.tracklets < 0)
    first = np.searchsorted(d.frame_of[free], frame[gaps] + 1)
    n = np.searchsorted(d.frame_of[free], frame[gaps] + 1, side="right") - first
    gap = np.repeat(np.arange(len(gaps)), n)  # each gap with each detection of its frame
    lone = free[np.arange(len(gap)) + np.repeat(first - np.cumsum(n) + n, n)]
    log_odds = _log_odds(((d.points[lone] - middle[gap]) ** 2).sum(axis=1), scale2, d.n_axes, model)
    order = np.argsort(-log_odds, kind="stable")
    order = order[log_odds[order] > math.log(CERTAIN / (1 - CERTAIN))]
    first_of_gap, first_of_lone = (np.unique(of[order], return_index=True)[1] for of in (gap, lone))
    taken = order[np.intersect1d(first_of_gap, first_of_lone)]
    before, lone = own[gaps[gap[taken]]], lone[taken]
    labels, tracklets = tracks.labels.copy(), found.tracklets.copy()
    labels[lone], tracklets[lone] = labels[before], tracklets[before]
    confidence = None if tracks.confidence is None else tracks.confidence.copy()
    if confidence is not None:
        confidence[lone] = 1 / (1 + np.exp(-log_odds[taken]))
    info = {**tracks.info, "lone": int(tracks.info.get("lone", 0)) + len(lone)}
    tracks = dataclasses.replace(tracks, labels=labels, confidence=confidence, info=info)
    return dataclasses.replace(found, tracks=tracks, tracklets=tracklets)


def _log_odds(
    squared: NDArray[np.float64], scale2: float, n_axes: int, model: TrackingModel
) -> NDArray[np.float64]:
    """Return the log odds of detections by their squared distances from the middle of gaps."""
    sensor, shape = model.sensor, (DEGREES + n_axes) / 2
    p_detection = sensor.p_detection
    scale2 = max(scale2, sensor.noise_sigma**2)  # of still markers without noise it is 0
    constant = (
        math.lgamma(shape) - math.lgamma(DEGREES / 2)
        - n_axes / 2 * math.log(math.pi * DEGREES * scale2)
        + 2 * math.log(p_detection)
        - math.log((1 - p_detection) * sensor.p_after_miss * sensor.clutter_density)
    )  # fmt: skip
    return constant - shape * np.log1p(squared / (DEGREES * scale2))
