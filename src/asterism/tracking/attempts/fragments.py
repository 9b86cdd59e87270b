"""Fragments of tracks, moved to markers that are absent meanwhile."""

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

__all__ = ["with_moved_fragments"]

LONGEST = 200
"""Largest number of detections of a fragment."""
ENOUGH = 15.0
"""Log odds by the posterior with shared accelerations from which a fragment is moved."""


def with_moved_fragments(
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration,
    progress: Callable[[int], Any] | None = None,
) -> NDArray[np.int64]:
    """Move fragments of tracks to markers that are absent meanwhile, where that is more probable.

    After a gap a track may continue with another marker. A fragment is a piece of a track between
    gaps and speeds that the model excludes, or the beginning of a piece until its first gap, or its
    end after the last one. The move with the largest log odds is made first, and changes those of
    the others.

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
    fragments = _fragments(tracks, model)
    markers = AbsentMarkers(tracks, tracks.labels, model, shared)
    queue: list[tuple[float, int]] = []
    for n, fragment in enumerate(fragments):
        heapq.heappush(queue, (-markers.best(fragment)[0], n))
        if progress is not None:
            progress(n * tracks.detections.n_frames // len(fragments))
    while queue and -queue[0][0] > ENOUGH:
        _, n = heapq.heappop(queue)
        label = markers.labels[fragments[n]]
        if (label != label[0]).any():
            continue  # a part of it was moved
        log_odds, marker = markers.best(fragments[n])
        if queue and log_odds < -queue[0][0]:
            heapq.heappush(queue, (-log_odds, n))
        elif log_odds > ENOUGH:
            markers.move(fragments[n], marker)
    return markers.labels


def _fragments(tracks: Tracks, model: TrackingModel) -> list[NDArray[np.int64]]:
    order, offsets = within_limits(tracks, model).by_track
    fragments = []
    for piece in np.split(order, offsets[1:-1]):
        gaps = np.flatnonzero(np.diff(tracks.detections.frame_of[piece]) > 1) + 1
        fragments.append(piece)
        if len(gaps):
            fragments += [piece[: gaps[0]], piece[gaps[-1] :]]
    return [fragment for fragment in fragments if 0 < len(fragment) <= LONGEST]
