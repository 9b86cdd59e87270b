"""Positions of occluded markers in the gaps of tracks, with their uncertainty."""

from asterism.tracking.filling.gaps import LONGEST, FilledGap, Filling, fill_gaps

__all__ = ["LONGEST", "FilledGap", "Filling", "fill_gaps"]
