"""Selection of every n-th frame of a capture that is too long for a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, Tracks

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["MOST_POINTS", "every_nth", "stride_for", "thinned"]

MOST_POINTS = 3_000_000
"""Largest number of points of a page, 10 to 20 MB; browsers open larger pages slowly."""


def stride_for(n_points: int) -> int:
    """Return the stride of the frames to keep: 1 for all, 2 for every second, and so on."""
    return max(1, -(-n_points // MOST_POINTS))


def every_nth(tracks: Tracks, stride: int) -> NDArray[np.int64]:
    """Return the detections in every `stride`-th frame, indices of shape (M,)."""
    return np.flatnonzero(tracks.detections.frame_of % stride == 0)


def thinned(tracks: Tracks, stride: int) -> Tracks:
    """Keep every `stride`-th frame, starting with the first.

    Parameters
    ----------
    tracks : Tracks
        Tracks of all frames.
    stride : int
        Stride; 1 keeps all frames.

    Returns
    -------
    Tracks
        Tracks over plain `Detections` with only the points and `filled`.
    """
    if stride == 1:
        return tracks
    d = tracks.detections
    kept = every_nth(tracks, stride)
    less = Detections(
        times=d.times[::stride],
        offsets=np.concatenate([[0], np.cumsum(d.counts[::stride])]),
        points=d.points[kept],
        filled=None if d.filled is None else d.filled[kept],
    )
    return Tracks(
        detections=less,
        labels=tracks.labels[kept],
        names=tracks.names,
        confidence=None if tracks.confidence is None else tracks.confidence[kept],
    )
