"""Which fragments of tracks are one marker, which one that is, and where it was in between."""

from asterism.label.automatic import track
from asterism.label.bonds import Bonds, learn_bonds
from asterism.label.filling import Filling, Gap, fill
from asterism.label.identify import FRAGMENT_GAP, fragment_model, identify
from asterism.label.recognition import Recognition, recognize
from asterism.label.stitched import Stitched, StitchedState
from asterism.label.stitching import Join, Stitching, stitch

__all__ = [
    "FRAGMENT_GAP",
    "Bonds",
    "Filling",
    "Gap",
    "Join",
    "Recognition",
    "Stitched",
    "StitchedState",
    "Stitching",
    "fill",
    "fragment_model",
    "identify",
    "learn_bonds",
    "recognize",
    "stitch",
    "track",
]
