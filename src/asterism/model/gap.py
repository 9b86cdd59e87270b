"""Gaps: frames in which a track has no detection, between two detections of it."""

from __future__ import annotations

from asterism.records import record

__all__ = ["Gap"]


@record
class Gap:
    """Frames without a detection of a track, between two detections of it.

    Parameters
    ----------
    track : int
        The track.
    first, last : int
        First and last frame of the gap.
    seconds : float
        Time from the detection before it to the one after.
    """

    track: int
    first: int
    last: int
    seconds: float

    @property
    def length(self) -> int:
        """Number of frames."""
        return self.last - self.first + 1
