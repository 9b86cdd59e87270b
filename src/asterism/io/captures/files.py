"""Reading and writing files of any known format."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_fields, check_file, check_kind, check_path
from asterism.errors import FormatError, ParameterError, not_read
from asterism.io.atomic import replacing
from asterism.io.captures.formats import CAPTURE_FORMATS, CaptureFormat
from asterism.io.text_table import as_utf8
from asterism.model import Capture, Detections, Tracks

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

__all__ = [
    "HEAD",
    "fitting_formats",
    "format_of",
    "format_to_write",
    "read",
    "read_tracks",
    "read_unlogged",
    "write",
]

log = logging.getLogger(__name__)

HEAD = 4096
"""Number of first bytes from which every format is recognised."""


def read(path: str | Path, *, format: str | None = None) -> Capture:
    """Read a capture from a file.

    Parameters
    ----------
    path : path
        File to read.
    format : str, optional
        Key of `CAPTURE_FORMATS`; by default it follows from the content, then from the suffix.

    Returns
    -------
    Capture
        Detections in metres with the identities and the axes of the file. Of a truncated C3D the
        complete frames are read; `Capture.truncated` and a log message report the missing part.
        `Capture.warnings` are logged too.

    Raises
    ------
    FormatError
        If the file does not exist, has no known format, or is malformed.
    ParameterError
        If `path` is not a path, or `format` is unknown.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.write(am.simulate.cube(frames=5, seed=1), f"{folder}/cube.c3d")
    ...     read(f"{folder}/cube.c3d").n_points
    40
    >>> read("nowhere.c3d")
    Traceback (most recent call last):
    ...
    asterism.errors.FormatError: nowhere.c3d: no such file
    """
    return _log_warnings(read_unlogged(path, format=format))


def read_unlogged(path: str | Path, *, format: str | None = None) -> Capture:
    """Read a capture as `read`, for a caller that shows `Capture.warnings` itself."""
    path = check_path("path", path)
    asked = None if format is None else _named(format)
    with _about(path):
        return _find(path, asked).read(path)


def read_tracks(path: str | Path, *, format: str | None = None) -> Tracks:
    """Read the tracks of a file, with their labels, names and confidence.

    Parameters
    ----------
    path, format
        As in `read`.

    Returns
    -------
    Tracks
        Tracks of a `Capture`. Asterism's CSV holds labels, names and confidence; in other formats
        each channel is a track, as in `Capture.tracks`.

    Raises
    ------
    FormatError, ParameterError
        As in `read`.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.write(am.simulate.cube(frames=5, seed=1), f"{folder}/cube.csv")
    ...     tracks = am.io.read_tracks(f"{folder}/cube.csv")
    >>> len(tracks), tracks.detections.n_points
    (8, 40)
    """
    path = check_path("path", path)
    asked = None if format is None else _named(format)
    with _about(path):
        chosen = _find(path, asked)
        if chosen.read_tracks is None:
            return _log_warnings(chosen.read(path)).tracks
        return chosen.read_tracks(path)


def write(
    tracks: Tracks | Detections,
    path: str | Path,
    *,
    format: str | None = None,
    overwrite_input: bool = False,
    unflagged: bool = False,
) -> None:
    """Write tracks to a file, completely or not at all.

    Parameters
    ----------
    tracks : Tracks or Detections
        Tracks to write. All detections are written, with the clutter.
    path : path
        File to write. An existing file is replaced, unless it is the input of the detections.
    format : str, optional
        Key of `CAPTURE_FORMATS`; by default it follows from the suffix.
    overwrite_input : bool
        Allow `path` to be the file that the detections were read from.
    unflagged : bool
        Allow filled points in a format that cannot mark them.

    Raises
    ------
    ParameterError
        If `path` is the input without `overwrite_input`, if its suffix is unknown, or if the format
        cannot hold the tracks or mark their filled points.
    FormatError
        If the file cannot be written, or the input cannot be read again.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.write(am.simulate.cube(frames=5, seed=1), f"{folder}/cube.trc")
    ...     [path.name for path in pathlib.Path(folder).iterdir()]
    ['cube.trc']
    """
    if isinstance(tracks, Detections):
        tracks = Tracks(detections=tracks, labels=np.full(tracks.n_points, -1))
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    path = check_path("path", path)
    chosen = format_to_write(path, format)
    assert chosen.write is not None
    source = tracks.detections
    if isinstance(source, Capture) and not overwrite_input and _is_same(source.path, path):
        raise ParameterError(
            "path", "another file than the one that was read", str(path),
            "give overwrite_input=True if you mean it",
        )  # fmt: skip
    if source.filled is not None and source.filled.any() and not (chosen.keeps_filled or unflagged):
        able = ", ".join(f.name for f in CAPTURE_FORMATS.values() if f.write and f.keeps_filled)
        raise ParameterError(
            "format", f"one that marks filled points: {able}",
            repr(chosen.name), "give unflagged=True to write them without a mark",
        )  # fmt: skip
    with replacing(path) as file:
        chosen.write(tracks, file)
    if isinstance(source, Capture) and source.truncated:
        log.warning("%s: holds the complete frames of a truncated capture, %s", path, source.path)


def _log_warnings(capture: Capture) -> Capture:
    """Log what is odd in the file, and whether frames are missing, and return the capture."""
    for warning in (*capture.warnings, *filter(None, [capture.truncated])):
        log.warning("%s: %s", capture.path, warning)
    return capture


def format_of(path: Path) -> CaptureFormat:
    """Detect the format of an existing capture by its content, then by its suffix.

    Parameters
    ----------
    path : Path
        File to examine.

    Returns
    -------
    CaptureFormat
        Entry of `CAPTURE_FORMATS`.

    Raises
    ------
    FormatError
        If the file does not exist or has no known format.
    """
    with _about(path):
        return _find(path, None)


def fitting_formats(head: bytes) -> list[CaptureFormat]:
    """Return the formats that the first `HEAD` bytes of a file fit."""
    text = as_utf8(head)
    return [f for f in CAPTURE_FORMATS.values() if f.sniff(text)]


def format_to_write(path: Path, format: str | None) -> CaptureFormat:
    """Return the requested format to write, or the format of the suffix.

    Parameters
    ----------
    path : Path
        File to write.
    format : str or None
        Key of `CAPTURE_FORMATS`; None selects by the suffix.

    Returns
    -------
    CaptureFormat
        Entry of `CAPTURE_FORMATS` that can be written.

    Raises
    ------
    ParameterError
        If the format or the suffix is unknown, or the format can only be read.
    """
    known = [f for f in CAPTURE_FORMATS.values() if f.write is not None]
    if format is None:
        for candidate in known:
            if path.suffix and path.suffix.lower() in candidate.extensions:
                return candidate
        every = ", ".join(dict.fromkeys(e for f in known for e in f.extensions if e))
        hint = "or name the format"
        raise ParameterError("path", f"a name ending in {every}", repr(path.name), hint)
    chosen = _named(format)
    if chosen.write is None:
        names = ", ".join(f.name for f in known)
        raise ParameterError("format", f"one that can be written: {names}", repr(format))
    return chosen


def _is_same(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:
        return a.resolve() == b.resolve()


def _named(name: str) -> CaptureFormat:
    check_fields("format", [name], CAPTURE_FORMATS)
    return CAPTURE_FORMATS[name]


def _find(path: Path, asked: CaptureFormat | None) -> CaptureFormat:
    """Return the requested format of an existing file, or the format of its content.

    If the content fits several formats or none, the suffix decides. In the latter case the reader
    of that format reports the error.
    """
    check_file(path)
    if asked is not None:
        return asked
    with path.open("rb") as file:
        head = file.read(HEAD)
    fitting = fitting_formats(head)
    ending = path.suffix.lower()
    named = [f for f in CAPTURE_FORMATS.values() if ending and ending in f.extensions]
    if fitting:
        return next((f for f in fitting if f in named), fitting[0])
    if len(named) == 1:
        return named[0]
    names = ", ".join(f"{f.name} ({f.description})" for f in named or CAPTURE_FORMATS.values())
    got = repr(head[:40]) if head else "an empty file"
    raise FormatError(path, "its first bytes", f"one of: {names}", got)


@contextmanager
def _about(path: Path) -> Generator[None, None, None]:
    """Turn an error of the system or of the data model into an error about the file."""
    try:
        yield
    except OSError as error:
        raise not_read(path, error) from error
    except ParameterError as error:
        raise FormatError(path, error.name, error.expected, error.got, error.hint) from error
