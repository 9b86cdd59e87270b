"""Which fragments of tracks are one marker, and where it was in between."""

from asterism.label.filling import Filling, Gap, fill
from asterism.label.identify import FRAGMENT_GAP, fragment_model, identify
from asterism.label.stitched import Stitched, StitchedState
from asterism.label.stitching import Join, Stitching, stitch

__all__ = [
    "FRAGMENT_GAP",
    "Filling",
    "Gap",
    "Join",
    "Stitched",
    "StitchedState",
    "Stitching",
    "fill",
    "fragment_model",
    "identify",
    "stitch",
]
