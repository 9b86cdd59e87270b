"""Naming: marker sets learnt from labelled captures, and names for tracks by them."""

from asterism.tracking.naming.check import check_names
from asterism.tracking.naming.conflicts import KeptNames, NameConflict
from asterism.tracking.naming.learn import learn_marker_set, merge_marker_sets
from asterism.tracking.naming.name import Naming, name_tracks
from asterism.tracking.naming.stream import Named, NamedState
from asterism.tracking.naming.stretches import NameChange

__all__ = [
    "KeptNames",
    "NameChange",
    "NameConflict",
    "Named",
    "NamedState",
    "Naming",
    "check_names",
    "learn_marker_set",
    "merge_marker_sets",
    "name_tracks",
]
