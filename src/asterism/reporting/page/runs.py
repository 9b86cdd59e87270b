"""Runs: unbroken stretches of a track, and the gaps between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Gaps", "Runs", "gaps_of", "runs_of"]


class Runs(NamedTuple):
    """Stretches of consecutive frames in which a track was seen, by track and then by time.

    Attributes
    ----------
    track, first, length : ndarray of int, shape (R,)
        Whose, from which frame, for how many.
    """

    track: NDArray[np.int64]
    first: NDArray[np.int64]
    length: NDArray[np.int64]


class Gaps(NamedTuple):
    """Frames between two runs of one track.

    Attributes
    ----------
    track, first, length : ndarray of int, shape (G,)
        Whose, the first frame without it, and for how many.
    seconds : ndarray, shape (G,)
        From the detection before to the one after.
    """

    track: NDArray[np.int64]
    first: NDArray[np.int64]
    length: NDArray[np.int64]
    seconds: NDArray[np.float64]


def runs_of(tracks: Tracks) -> Runs:
    """Cut every track where a frame is without it."""
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
