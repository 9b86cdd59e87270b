"""Runs of consecutive frames of a track, and the gaps between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Gaps", "Runs", "gaps_of", "runs_of"]


class Runs(NamedTuple):
    """Runs of consecutive frames with a detection, by track and then by time.

    Attributes
    ----------
    track, first, length : ndarray of int, shape (R,)
        Track, first frame and number of frames of each run.
    """

    track: NDArray[np.int64]
    first: NDArray[np.int64]
    length: NDArray[np.int64]


class Gaps(NamedTuple):
    """Frames between two runs of one track.

    Attributes
    ----------
    track, first, length : ndarray of int, shape (G,)
        Track, first missing frame and number of missing frames of each gap.
    seconds : ndarray of shape (G,)
        Time from the detection before the gap to the one after it, seconds.
    """

    track: NDArray[np.int64]
    first: NDArray[np.int64]
    length: NDArray[np.int64]
    seconds: NDArray[np.float64]


def runs_of(tracks: Tracks) -> Runs:
    """Split every track at its missed detections."""
    order, _ = tracks.by_track
    track, frame = tracks.labels[order], tracks.detections.frame_of[order]
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (np.diff(track) != 0) | (np.diff(frame) != 1)
    begins = np.flatnonzero(is_first)
    length = np.diff(np.append(begins, len(order)))
    return Runs(track[begins], frame[begins], length)


def gaps_of(tracks: Tracks) -> Gaps:
    """Return the gaps within tracks."""
    runs, times = runs_of(tracks), tracks.detections.times
    ends = runs.first + runs.length
    i = np.flatnonzero(np.diff(runs.track) == 0)
    first, after = ends[i], runs.first[i + 1]
    return Gaps(runs.track[i], first, after - first, times[after] - times[first - 1])
