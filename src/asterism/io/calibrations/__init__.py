"""Reading and writing of calibrations, one module per format.

>>> from asterism.io.calibrations import read_rig, write_rig
>>> rig = read_rig("walk.xcp")                             # doctest: +SKIP
>>> write_rig(rig, "walk.toml")                            # doctest: +SKIP
"""

from asterism.io.calibrations.files import read_rig, write_rig
from asterism.io.calibrations.formats import CALIBRATION_FORMATS, CalibrationFormat

__all__ = ["CALIBRATION_FORMATS", "CalibrationFormat", "read_rig", "write_rig"]
