"""Gaps: frames without a detection inside a track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Gap", "gaps_of"]


@record
class Gap:
    """Frames without a detection inside a track.

    Parameters
    ----------
    track : int
        Number of the track.
    first, last : int
        First and last frame of the gap.
    seconds : float
        Time between the detections before and after the gap.

    Examples
    --------
    >>> gap = Gap(track=0, first=10, last=14, seconds=0.06)
    >>> gap.length
    5
    """

    track: int
    first: int
    last: int
    seconds: float

    @property
    def length(self) -> int:
        """Number of frames of the gap."""
        return self.last - self.first + 1


def gaps_of(
    tracks: NDArray[np.int64], frames: NDArray[np.int64], times: NDArray[np.float64]
) -> tuple[Gap, ...]:
    """Return the gaps of all tracks, ordered by track and then by time.

    Parameters
    ----------
    tracks, frames : ndarray of int, shape (M,)
        Track and frame of each detection, ordered by track and then by time.
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    """
    before = np.flatnonzero((np.diff(tracks) == 0) & (np.diff(frames) > 1))
    return tuple(
        Gap(
            track=int(tracks[i]),
            first=int(frames[i]) + 1,
            last=int(frames[i + 1]) - 1,
            seconds=float(times[frames[i + 1]] - times[frames[i]]),
        )
        for i in before
    )
