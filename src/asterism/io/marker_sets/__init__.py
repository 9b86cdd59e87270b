"""Reading of marker sets.

>>> from asterism.io.marker_sets import read_marker_set
>>> made = read_marker_set("subject.vsk")                  # doctest: +SKIP
"""

from asterism.io.marker_sets.files import read_marker_set

__all__ = ["read_marker_set"]
