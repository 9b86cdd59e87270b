"""Tracking of large scenes: 100 000 detections a frame and more, streamed from and to tables."""

from asterism.large.tracker import LargeTracker as LargeTracker

__all__ = ["LargeTracker"]
