"""Selection of frames of a capture that is too long for a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, Tracks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.reporting.places import Place

__all__ = ["MOST_POINTS", "frames_to_show", "stride_for", "thinned"]

MOST_POINTS = 3_000_000
"""Number of points from which frames are left out; a page of them has 10 to 20 MB."""
AROUND = 0.5
"""Time about the worst part of a place within which every frame is kept, seconds."""
MAX_AROUND = 0.25
"""Largest share of `MOST_POINTS` that is kept about places, those of the worst places first."""


def stride_for(n_points: int) -> int:
    """Return the stride of the frames to keep: 1 for all, 2 for every second, and so on."""
    return max(1, -(-n_points // MOST_POINTS))


def frames_to_show(tracks: Tracks, places: Sequence[Place]) -> NDArray[np.int64]:
    """Select every `stride_for`-th frame, and every frame about the places to check.

    Parameters
    ----------
    tracks : Tracks
        Tracks of all frames.
    places : sequence of Place
        Places to check, the worst first.

    Returns
    -------
    ndarray of int
        Frames, increasing.
    """
    d = tracks.detections
    stride = stride_for(d.n_points)
    is_shown = np.zeros(d.n_frames, dtype=bool)
    is_shown[::stride] = True
    room = MAX_AROUND * MOST_POINTS
    for place in places if stride > 1 else ():
        worst = place.decisions[0]
        about = d.times[[worst.first, worst.last]] + [-AROUND, AROUND]
        near = np.arange(*np.searchsorted(d.times, about))
        room -= d.counts[near[~is_shown[near]]].sum()
        if room < 0:
            break
        is_shown[near] = True
    return np.flatnonzero(is_shown)


def thinned(tracks: Tracks, frames: NDArray[np.int64]) -> tuple[Tracks, NDArray[np.int64]]:
    """Keep some frames.

    Parameters
    ----------
    tracks : Tracks
        Tracks of all frames.
    frames : ndarray of int
        Frames to keep, increasing.

    Returns
    -------
    tracks : Tracks
        Tracks over plain `Detections` with only the points and `filled`, without decisions.
    kept : ndarray of int, shape (M,)
        Their detections among those of all frames.
    """
    d = tracks.detections
    is_kept = np.zeros(d.n_frames, dtype=bool)
    is_kept[frames] = True
    kept = np.flatnonzero(is_kept[d.frame_of])
    less = Detections(
        times=d.times[frames],
        offsets=np.concatenate([[0], np.cumsum(d.counts[frames])]),
        points=d.points[kept],
        filled=None if d.filled is None else d.filled[kept],
    )
    confidence, identity = tracks.confidence, tracks.identity_confidence
    few = Tracks(
        detections=less,
        labels=tracks.labels[kept],
        names=tracks.names,
        confidence=None if confidence is None else confidence[kept],
        identity_confidence=None if identity is None else identity[kept],
    )
    return few, kept
