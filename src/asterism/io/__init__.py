"""Files in and out: one file a format; units, axes and gaps are converted here and nowhere else.

>>> import asterism as am
>>> capture = am.read("trial.c3d")                        # doctest: +SKIP
>>> am.write(capture.tracks, "trial.csv")                 # doctest: +SKIP
"""

from asterism.io.files import read, read_tracks, write
from asterism.io.formats import FORMATS, Format
from asterism.io.info import CaptureInfo, describe

__all__ = ["FORMATS", "CaptureInfo", "Format", "describe", "read", "read_tracks", "write"]
