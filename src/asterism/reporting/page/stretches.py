"""Detections of one track that are close in time, taken together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["stretches"]

TOGETHER = 0.1
"""Seconds by which detections of one stretch are apart at most; a frame and a half where slower."""


def stretches(
    tracks: Tracks, members: NDArray[np.int64]
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Group labelled detections.

    Parameters
    ----------
    tracks : Tracks
    members : ndarray of int, shape (M,)
        The detections, all in tracks.

    Yields
    ------
    track : int
    group : ndarray of int
        Its detections that are close in time, in order.
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
