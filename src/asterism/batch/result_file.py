"""Format and path of the result of a capture, and the folder of many."""

from __future__ import annotations

from pathlib import Path

from asterism.checks import check_fields
from asterism.errors import ParameterError
from asterism.io import CAPTURE_FORMATS
from asterism.io.atomic import holds_files

__all__ = ["check_folder", "default_output", "output_format"]

# A log of point clouds cannot hold labels.
_WITHOUT_TRACKS = ("pointcloud",)


def output_format(
    out: Path | None, name: str | None, source: str = "c3d", *, option: str = "--out"
) -> str:
    """Return the format of a result.

    Parameters
    ----------
    out : Path or None
        File to write; None if its name follows from the format.
    name : str or None
        Format that the user gives; None if it follows from `out`.
    source : str
        Format of the capture, used without `name` and `out`.
    option : str
        Option of the file, for the messages.

    Returns
    -------
    str
        `name`, or the format with the ending of `out`, or that of the capture. A capture in a
        format that cannot be written gives C3D, one that cannot hold tracks CSV.

    Raises
    ------
    ParameterError
        If the format is unknown or cannot hold tracks.
    """
    known = {
        f.name: f
        for f in CAPTURE_FORMATS.values()
        if f.write is not None and f.name not in _WITHOUT_TRACKS
    }
    if name is not None:
        check_fields("--format", [name], known)
        return name
    if out is not None:
        for format in known.values():
            if out.suffix and out.suffix.lower() in format.extensions:
                return format.name
        suffixes = ", ".join(dict.fromkeys(e for f in known.values() for e in f.extensions))
        raise ParameterError(option, f"a name ending in {suffixes}", str(out), "or give --format")
    if source in _WITHOUT_TRACKS:
        return "csv"
    return source if source in known else "c3d"


def default_output(source: Path, format: str) -> Path:
    """Return the default path of a result: ``trial.tracked.c3d`` beside ``trial.c3d``."""
    suffixes = CAPTURE_FORMATS[format].extensions
    ending = source.suffix if source.suffix.lower() in suffixes else suffixes[0]
    return source.with_name(f"{source.stem}.tracked{ending}")


def check_folder(out: str, what: str, *, allowed: bool) -> None:
    """Raise unless an output folder is new, empty, or allowed to hold files.

    Parameters
    ----------
    out : str
        Folder.
    what : str
        What the folder would be resumed as, for the message, such as "a batch".
    allowed : bool
        Whether it may hold files.

    Raises
    ------
    ParameterError
        If it is a file, or holds files.
    """
    path = Path(out)
    if path.exists() and not path.is_dir():
        raise ParameterError("out", "a folder or a new name", f"the file {path}")
    if path.is_dir() and holds_files(path) and not allowed:
        expected = f"a new folder, an empty one, or that of {what}"
        hint = "give overwrite=True to add to it"
        raise ParameterError("out", expected, f"{path}, which holds files", hint)
