"""Reading and writing calibrations of any known format."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_fields, check_file, check_kind, check_path
from asterism.errors import FormatError, ParameterError, not_read, not_written
from asterism.io.atomic import replacing
from asterism.io.calibrations.formats import CALIBRATION_FORMATS, CalibrationFormat
from asterism.io.text_table import as_utf8
from asterism.io.units import PER_METRE, parse_unit

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["format_of", "format_to_write", "read_rig", "write_rig"]

_HEAD = 1 << 16  # bytes that are enough to know a format by


def read_rig(path: str | Path, *, format: str | None = None, units: str | None = None) -> Rig:
    """Read the cameras of a calibration.

    Parameters
    ----------
    path : path
        The file or the folder.
    format : str, optional
        Key of `CALIBRATION_FORMATS`; by default it follows from the content.
    units : {"mm", "cm", "m", "in", "ft"}, optional
        Unit of length, for files that do not state it. By default it is estimated for these.

    Returns
    -------
    Rig
        Cameras in metres and pixels. Its `warnings` list estimated values and cameras left out.

    Raises
    ------
    FormatError
        If the calibration does not exist, has no known format, or is malformed.
    ParameterError
        If `format` or `units` is unknown, or the format has another unit by definition.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.io.write_rig(am.Rig.ring(4, radius=3, height=2), f"{folder}/rig.toml")
    ...     read_rig(f"{folder}/rig.toml").names
    ('cam1', 'cam2', 'cam3', 'cam4')
    >>> read_rig("none.toml")
    Traceback (most recent call last):
    ...
    asterism.errors.FormatError: none.toml: no such file
    """
    path = check_path("path", path)
    chosen = None if format is None else _named(format)
    unit = _unit(units)
    try:
        chosen = format_of(path) if chosen is None else _openable(path, chosen)
        if unit is not None and chosen.unit not in (None, unit):
            expected = f"{chosen.unit}, as in all files of format {chosen.name}"
            raise ParameterError("units", expected, repr(units))
        with np.errstate(all="ignore"):  # the data model refuses numbers that overflowed
            return chosen.read(path, unit)
    except OSError as error:
        raise not_read(path, error) from error


def write_rig(
    rig: Rig, path: str | Path, *, format: str | None = None, overwrite: bool = False
) -> None:
    """Write the cameras of a rig to a calibration, completely or not at all.

    Parameters
    ----------
    rig : Rig
        Cameras to write.
    path : path
        File to write; an existing one is replaced. For a folder format (flydra, myptv) the
        folder, which must be new or empty, so that files of another rig do not mix with these.
    format : str, optional
        Key of `CALIBRATION_FORMATS`; by default it follows from the suffix. ``.toml`` selects the
        format "rig", which keeps every field bit for bit.
    overwrite : bool
        Allow a folder that holds files, if all of them are replaced.

    Raises
    ------
    ParameterError
        If the format is unknown or cannot hold a camera, or if the folder is not empty. `fit_lens`
        fits a lens that the format can hold, and returns the error of the fit.
    FormatError
        If the file cannot be written.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.io.write_rig(am.Rig.ring(4, radius=3, height=2), f"{folder}/rig.toml")
    ...     am.read_rig(f"{folder}/rig.toml").names
    ('cam1', 'cam2', 'cam3', 'cam4')
    """
    check_kind("rig", rig, Rig)
    path = check_path("path", path)
    chosen = format_to_write(path, format)
    for i, camera in enumerate(rig):
        if not camera.name.isprintable():
            raise ParameterError(f"the name of camera {i}", "printable text", repr(camera.name))
    content = chosen.write(rig)
    if isinstance(content, bytes):
        with replacing(path) as file:
            file.write(content)
    else:
        _write_folder(path, content, overwrite=overwrite)


def _write_folder(path: Path, content: dict[str, bytes], *, overwrite: bool) -> None:
    try:
        if path.exists() and not path.is_dir():
            raise ParameterError("path", "a folder that is new or empty", f"{path}, a file")
        there = sorted(file.name for file in path.iterdir()) if path.exists() else []
        left = [name for name in there if name not in content] if overwrite else there
        if left:
            expected = (
                "a folder without other files" if overwrite else "a folder that is new or empty"
            )
            raise ParameterError("path", expected, f"{path}, which holds {left[0]}")
        path.mkdir(exist_ok=True)
        for name, text in content.items():
            with replacing(path / name) as file:
                file.write(text)
    except OSError as error:
        raise not_written(path, error) from error


def format_to_write(path: Path, format: str | None) -> CalibrationFormat:
    """Return the requested format to write, or the format of the suffix.

    Parameters
    ----------
    path : Path
        File or folder to write.
    format : str or None
        Key of `CALIBRATION_FORMATS`; None selects by the suffix.

    Returns
    -------
    CalibrationFormat
        Entry of `CALIBRATION_FORMATS`.

    Raises
    ------
    ParameterError
        If the format or the suffix is unknown.
    """
    if format is not None:
        return _named(format)
    for candidate in CALIBRATION_FORMATS.values():
        if path.name.lower().endswith(candidate.extensions):
            return candidate
    every = ", ".join(dict.fromkeys(e for c in CALIBRATION_FORMATS.values() for e in c.extensions))
    folders = " and ".join(
        c.name for c in CALIBRATION_FORMATS.values() if c.sniff_folder is not None
    )
    hint = f"or name the format: {folders} are folders"
    raise ParameterError("path", f"a name ending in {every}", repr(path.name), hint)


def _named(name: str) -> CalibrationFormat:
    check_fields("format", [name], CALIBRATION_FORMATS)
    return CALIBRATION_FORMATS[name]


def _unit(units: str | None) -> str | None:
    if units is None:
        return None
    unit = parse_unit(units)
    if unit is None:
        raise ParameterError("units", f"one of {', '.join(PER_METRE)}", repr(units))
    return unit


def _openable(path: Path, chosen: CalibrationFormat) -> CalibrationFormat:
    """Check that the path is a file or a folder, as the format requires."""
    is_folder = path.is_dir()
    fits = chosen.sniff_folder is not None if is_folder else chosen.sniff is not None
    if (is_folder or path.is_file()) and fits:
        return chosen
    kinds = [k for k, f in (("file", chosen.sniff), ("folder", chosen.sniff_folder)) if f]
    expected = f"a {' or a '.join(kinds)} of format {chosen.name}"
    if is_folder:
        raise FormatError(path, "", expected, "a folder")
    check_file(path, expected)
    raise FormatError(path, "", expected, "a file")


def format_of(path: Path) -> CalibrationFormat:
    """Detect the format of an existing calibration by its content.

    If the content fits several formats or none, the ending of the name decides.

    Parameters
    ----------
    path : Path
        The file or the folder.

    Returns
    -------
    CalibrationFormat
        Entry of `CALIBRATION_FORMATS`.

    Raises
    ------
    FormatError
        If the path does not exist or has no known format.
    """
    every = list(CALIBRATION_FORMATS.values())
    if path.is_dir():
        for candidate in every:
            if candidate.sniff_folder is not None and candidate.sniff_folder(path):
                return candidate
        expected = "camera1.Pmat.cal and so on, or camera files of MyPTV"
        raise FormatError(path, "its files", expected, "none of them")
    check_file(path, "a calibration")
    with path.open("rb") as file:
        head = file.read(_HEAD)
    fitting = [c for c in every if c.sniff is not None and c.sniff(as_utf8(head))]
    by_name = [c for c in every if path.name.lower().endswith(c.extensions)]
    if fitting:
        return next((c for c in fitting if c in by_name), fitting[0])
    if by_name:
        return by_name[-1]  # its reader reports the error
    known = ", ".join(f"{c.name} ({c.description})" for c in every)
    raise FormatError(path, "its first bytes", f"one of: {known}", repr(head[:40]))
