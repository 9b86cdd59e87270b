"""Grouping of detections of one track that are close in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["stretches"]

TOGETHER = 0.1
"""Largest distance in time within a group, seconds; 1.5 frames at lower frame rates."""


def stretches(
    tracks: Tracks, members: NDArray[np.int64]
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Group labelled detections that are close in time.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the detections.
    members : ndarray of int, shape (M,)
        Indices of labelled detections.

    Yields
    ------
    track : int
        Track of the group.
    group : ndarray of int
        Indices of its detections in the order of time.
    """
    if not len(members):
        return
    d = tracks.detections
    members = members[np.lexsort((d.frame_of[members], tracks.labels[members]))]
    track, time = tracks.labels[members], d.times[d.frame_of[members]]
    near = max(TOGETHER, 1.5 * d.step)
    cuts = np.flatnonzero((np.diff(track) != 0) | (np.diff(time) > near)) + 1
    for group in np.split(members, cuts):
        yield int(tracks.labels[group[0]]), group
