"""Tracking of large scenes: 100 000 detections a frame and more, streamed from and to tables."""

from asterism.large.columns import Columns
from asterism.large.sample import estimate_from_start
from asterism.large.state import DecidedFrame, LargeState
from asterism.large.track import LargeRun, track
from asterism.large.tracker import LargeTracker

__all__ = [
    "Columns",
    "DecidedFrame",
    "LargeRun",
    "LargeState",
    "LargeTracker",
    "estimate_from_start",
    "track",
]
