"""Reading and writing of files; only these modules convert units, axes and gaps.

>>> import asterism as am
>>> capture = am.read("trial.c3d")                        # doctest: +SKIP
>>> am.write(capture.tracks, "trial.csv")                 # doctest: +SKIP
"""

from asterism.io.calibrations import CALIBRATION_FORMATS, CalibrationFormat, read_rig, write_rig
from asterism.io.captures import (
    CAPTURE_FORMATS,
    CaptureFormat,
    CaptureInfo,
    describe,
    read,
    read_tracks,
    write,
)
from asterism.io.edits import read_edits, write_edits
from asterism.io.marker_sets import read_marker_set
from asterism.io.observations import read_observations, write_observations

__all__ = [
    "CALIBRATION_FORMATS",
    "CAPTURE_FORMATS",
    "CalibrationFormat",
    "CaptureFormat",
    "CaptureInfo",
    "describe",
    "read",
    "read_edits",
    "read_marker_set",
    "read_observations",
    "read_rig",
    "read_tracks",
    "write",
    "write_edits",
    "write_observations",
    "write_rig",
]
