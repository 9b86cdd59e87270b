"""Tracklets that continue each other after a few frames, joined before they are named."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["joined"]

MAX_GAP = 5
"""Largest number of frames from the end of a tracklet to the start of the next."""
MIN_LENGTH = 5
"""Smallest number of detections of a tracklet that is joined: shorter ones have no velocity."""
STEPS = 3
"""Number of detections over which a velocity is measured."""
MAX_ERROR = 0.02
"""Largest distance between both extrapolations, metres."""
MIN_RATIO, MARGIN = 3.0, 0.005
"""Factor and metres by which the error of every other join of both tracklets must be larger."""


def joined(tracks: Tracks) -> Tracks:
    """Join tracklets where one clearly continues another.

    Parameters
    ----------
    tracks : Tracks
        Tracks or tracklets.

    Returns
    -------
    Tracks
        Tracks of the same detections. Two tracklets are joined if the extrapolations of both meet
        in the middle of the gap, and any other join of either would be much worse.
    """
    order, offsets = tracks.by_track
    long = np.flatnonzero(tracks.lengths >= MIN_LENGTH)
    if len(long) < 2:
        return tracks
    start, end = offsets[long], offsets[long + 1] - 1
    points = tracks.detections.points[order]
    frames = tracks.detections.frame_of[order]

    def step(one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.float64]:
        return (points[other] - points[one]) / (frames[other] - frames[one])[:, None]

    leaving, arriving = step(end - STEPS, end), step(start, start + STEPS)
    by_end = np.argsort(frames[end], kind="stable")
    ends = frames[end][by_end]
    before: list[NDArray[np.int64]] = []
    after: list[NDArray[np.int64]] = []
    for k, first in enumerate(frames[start]):
        own = by_end[slice(*np.searchsorted(ends, [first - MAX_GAP, first]))]
        before.append(own)
        after.append(np.full(len(own), k))
    one, other = np.concatenate(before), np.concatenate(after)
    gap = (frames[start[other]] - frames[end[one]])[:, None]
    middle = points[end[one]] + leaving[one] * gap / 2
    off = middle - (points[start[other]] - arriving[other] * gap / 2)
    error = np.linalg.norm(off, axis=1)
    least, runner_up = np.full(len(error), np.inf), np.full(len(error), np.inf)
    for side in (one, other):
        best, second = _two_smallest(error, side, len(long))
        least = np.minimum(least, best[side])
        runner_up = np.minimum(runner_up, second[side])
    is_clear = (error == least) & (error < MAX_ERROR)
    is_clear &= runner_up > MIN_RATIO * error + MARGIN
    number = np.arange(tracks.n_tracks + 1)
    number[-1] = -1
    clear = np.flatnonzero(is_clear)
    for i in clear[np.argsort(frames[start[other[clear]]], kind="stable")]:
        number[long[other[i]]] = number[long[one[i]]]
    labels = number[tracks.labels]
    kept = np.unique(number[:-1])
    return replace(tracks, labels=np.where(labels < 0, -1, np.searchsorted(kept, labels)), names=())


def _two_smallest(
    values: NDArray[np.float64], groups: NDArray[np.int64], n_groups: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the smallest value of each group and the next one, infinite without any."""
    order = np.lexsort((values, groups))
    group, value = groups[order], values[order]
    place = np.arange(len(group)) - np.searchsorted(group, group)
    smallest = np.full((2, n_groups), np.inf)
    for p in (0, 1):
        smallest[p, group[place == p]] = value[place == p]
    return smallest[0], smallest[1]
