"""Options of all commands that read a calibration of cameras."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import asterism as am

__all__ = ["CalibrationFile", "FromFormat", "LengthUnits", "read_calibration"]

CalibrationFile = Annotated[
    Path, typer.Argument(metavar="CALIB", help="Calibration: a file or a folder.")
]
FromFormat = Annotated[
    str | None,
    typer.Option("--from", metavar="FORMAT", help="Format of CALIB.", show_default="detected"),
]
LengthUnits = Annotated[
    str | None,
    typer.Option(metavar="mm|cm|m", help="Unit of length of CALIB.", show_default="from the files"),
]


def read_calibration(path: Path, from_format: str | None, units: str | None) -> am.Rig:
    """Read a calibration in the format and the unit of the options."""
    from asterism.cli.options import as_options
    from asterism.io.calibrations import read_rig

    with as_options({"format": "--from", "units": "--units"}):
        return read_rig(path, format=from_format, units=units)
