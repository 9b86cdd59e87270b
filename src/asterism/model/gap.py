"""Gaps: frames without a detection inside a track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from asterism.model.tracks import Tracks

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


def gaps_of(tracks: Tracks) -> tuple[Gap, ...]:
    """Return the gaps of all tracks, ordered by track and then by time; see `Tracks.gaps`."""
    order, _ = tracks.by_track
    frame, track = tracks.detections.frame_of[order], tracks.labels[order]
    before = np.flatnonzero((np.diff(track) == 0) & (np.diff(frame) > 1))
    times = tracks.detections.times
    return tuple(
        Gap(
            track=int(track[i]),
            first=int(frame[i]) + 1,
            last=int(frame[i + 1]) - 1,
            seconds=float(times[frame[i + 1]] - times[frame[i]]),
        )
        for i in before
    )
