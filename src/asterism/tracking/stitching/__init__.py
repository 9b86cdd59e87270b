"""Stitching of tracklets into tracks of markers, for whole captures and for streams."""

from asterism.tracking.stitching.stream import Stitched, StitchedState
from asterism.tracking.stitching.tracklets import MAX_TRACKLET_GAP, tracklet_model
from asterism.tracking.stitching.whole import Join, Stitching, stitch

__all__ = [
    "MAX_TRACKLET_GAP",
    "Join",
    "Stitched",
    "StitchedState",
    "Stitching",
    "stitch",
    "tracklet_model",
]
