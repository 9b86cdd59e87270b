"""Counts of detected and missed markers: the gaps of tracks, without those of lost markers.

A tracker that loses a marker at a jolt leaves a gap like that of an occluded marker. In such a gap
the marker was detected: a point lies near the predicted position, in no track, or in a track that
starts within the gap (backward in time: that ends within it). These gaps are not counted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism._engine import NearestPoints

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Sightings", "count_sightings"]


class Sightings(NamedTuple):
    """Numbers of frames in which present markers were detected and missed.

    Parameters
    ----------
    hits, misses : int
        Counts for markers that were detected in the frame before.
    rehits, remisses : int
        Counts for markers that were missed in the frame before.
    """

    hits: int
    misses: int
    rehits: int
    remisses: int


def count_sightings(tracks: Tracks, reach: float) -> Sightings:
    """Count detections and missed detections between the first and the last of each track.

    Parameters
    ----------
    tracks : Tracks
        Tracks to count in.
    reach : float
        Largest distance between the predicted position and an unassigned point of the marker,
        metres.

    Returns
    -------
    Sightings
    """
    d = tracks.detections
    order, offsets = tracks.by_track
    frame = d.frame_of[order]
    is_link = np.diff(tracks.labels[order]) == 0
    missed = (np.diff(frame) - 1) * is_link
    gaps = np.flatnonzero(missed > 0)  # each gap follows the detection order[gap]
    first, last = frame[offsets[:-1]], frame[offsets[1:] - 1]
    begins = np.append(first, d.n_frames)[tracks.labels]  # clutter: after any gap's start
    ends = np.append(last, -1)[tracks.labels]
    was_lost = _is_left_over(tracks, order, gaps, begins, +1, reach)
    was_lost |= _is_left_over(tracks, order, gaps + 1, ends, -1, reach)
    real = gaps[~was_lost]
    n_links, n_gaps, n_missed = int(is_link.sum()), len(real), int(missed[real].sum())
    return Sightings(n_links - n_gaps, n_gaps, n_gaps, n_missed - n_gaps)


def _is_left_over(
    tracks: Tracks,
    order: NDArray[np.int64],
    at: NDArray[np.int64],
    limits: NDArray[np.int64],
    way: int,
    reach: float,
) -> NDArray[np.bool_]:
    """Find the gaps in which the marker was detected but not assigned to the track.

    Parameters
    ----------
    tracks, reach
        As in `count_sightings`.
    order : ndarray of int, shape (M,)
        Detections ordered by track.
    at : ndarray of int, shape (G,)
        Positions in `order` at which tracks have a gap.
    limits : ndarray of int, shape (N,)
        Frame in which the track of each detection starts (backward: ends).
    way : {1, -1}
        1: forward from the start of the gap; -1: backward from its end.
    """
    d = tracks.detections
    free = np.flatnonzero(way * limits > way * (d.frame_of - way))  # in the next frame
    if not len(at) or not len(free):
        return np.zeros(len(at), dtype=bool)
    now = order[at]
    before = order[np.clip(at - way, 0, len(order) - 1)]
    t = d.frame_of[now]
    is_steady = (tracks.labels[before] == tracks.labels[now]) & (d.frame_of[before] == t - way)
    step = (d.times[t + way] - d.times[t]) / np.where(
        is_steady, d.times[t] - d.times[d.frame_of[before]], np.inf
    )
    places = d.points[now] + (d.points[now] - d.points[before]) * step[:, None]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(d.frame_of[free], minlength=d.n_frames))])
    distance = NearestPoints(d.points[free], offsets).two(places, t + way)[1][:, 0]
    return np.asarray(distance <= reach)
