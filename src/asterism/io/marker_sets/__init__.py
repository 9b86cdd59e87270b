"""Files of marker sets."""

from asterism.io.marker_sets.files import read_marker_set

__all__ = ["read_marker_set"]
