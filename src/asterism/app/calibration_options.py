"""Options of all commands that read a calibration of cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["CalibrationFile", "FromFormat", "LengthUnits"]

CalibrationFile = Annotated[
    Path, typer.Argument(metavar="CALIB", help="Calibration: a file or a folder.")
]
FromFormat = Annotated[
    str | None, typer.Option("--from", metavar="FORMAT", help="Format, if it cannot be told.")
]
LengthUnits = Annotated[
    str | None, typer.Option(metavar="mm|cm|m", help="Unit of length, if the files do not say it.")
]
