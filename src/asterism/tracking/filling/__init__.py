"""Positions of occluded markers in the gaps of tracks, with their uncertainty."""

from asterism.tracking.filling.gaps import Filling, Gap, fill_gaps

__all__ = ["Filling", "Gap", "fill_gaps"]
