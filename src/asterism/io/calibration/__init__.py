"""Calibrations in and out: one file a format; units and conventions are converted here only.

>>> from asterism.io.calibration import read_rig, write_rig
>>> rig = read_rig("walk.xcp")                             # doctest: +SKIP
>>> write_rig(rig, "walk.toml")                            # doctest: +SKIP
"""

from asterism.io.calibration.files import read_rig, write_rig
from asterism.io.calibration.formats import CALIBRATIONS, CalibrationFormat

__all__ = ["CALIBRATIONS", "CalibrationFormat", "read_rig", "write_rig"]
