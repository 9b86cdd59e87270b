"""Tracklets of other markers in a track, moved to the markers that are absent meanwhile."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.tracking.attempts.absent_markers import AbsentMarkers
from asterism.tracking.attempts.posterior import within_limits

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration, TrackingModel, Tracks

__all__ = ["with_moved_tracklets"]

MAX_LENGTH = 200
"""Largest number of detections of a tracklet."""
MIN_LOG_ODDS = 15.0
"""Log odds by the posterior with shared accelerations from which a tracklet is moved."""


def with_moved_tracklets(
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration,
    progress: Callable[[int], Any] | None = None,
) -> NDArray[np.int64]:
    """Move tracklets to markers that are absent meanwhile, where that is more probable.

    After a gap, a track may continue on another marker that has no track there. A tracklet is the
    part of a track between gaps and speeds that the model excludes, or the beginning of such a part
    until its first gap, or its end after the last one. The move with the largest log odds is made
    first, and each is compared again before it is made.

    Parameters
    ----------
    tracks : Tracks
        Tracks of markers.
    model : TrackingModel
        Model of the markers' own motion.
    shared : SharedAcceleration
        Shared accelerations, learnt from the tracks.
    progress : callable, optional
        Called with the number of finished frames of the capture.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter, with the numbers of the given tracks.
    """
    n_frames, tracklets = tracks.detections.n_frames, _tracklets(tracks, model)
    markers = AbsentMarkers(tracks, tracks.labels, model, shared)
    queue: list[tuple[float, int]] = []
    for n, tracklet in enumerate(tracklets):
        heapq.heappush(queue, (-markers.best(tracklet)[0], n))
        if progress is not None:
            progress((n + 1) * n_frames // len(tracklets))
    while queue and -queue[0][0] > MIN_LOG_ODDS:
        _, n = heapq.heappop(queue)
        log_odds, marker = markers.best(tracklets[n])
        if queue and log_odds < -queue[0][0]:
            heapq.heappush(queue, (-log_odds, n))
        elif log_odds > MIN_LOG_ODDS:
            markers.move(tracklets[n], marker)
    return markers.labels


def _tracklets(tracks: Tracks, model: TrackingModel) -> list[NDArray[np.int64]]:
    order, offsets = within_limits(tracks, model).by_track
    tracklets = []
    for part in np.split(order, offsets[1:-1]):
        gaps = np.flatnonzero(np.diff(tracks.detections.frame_of[part]) > 1) + 1
        tracklets.append(part)
        if len(gaps):
            tracklets += [part[: gaps[0]], part[gaps[-1] :]]
    return [tracklet for tracklet in tracklets if 0 < len(tracklet) <= MAX_LENGTH]
