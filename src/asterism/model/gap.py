"""Gaps: frames without a detection inside a track."""

from __future__ import annotations

from asterism.records import record

__all__ = ["Gap"]


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
