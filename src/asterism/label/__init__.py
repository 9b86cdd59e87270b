"""Which fragments of tracks are one marker: stitching through gaps of any length."""

from asterism.label.identify import FRAGMENT_GAP, fragment_model, identify
from asterism.label.stitched import Stitched, StitchedState
from asterism.label.stitching import Join, Stitching, stitch

__all__ = [
    "FRAGMENT_GAP",
    "Join",
    "Stitched",
    "StitchedState",
    "Stitching",
    "fragment_model",
    "identify",
    "stitch",
]
