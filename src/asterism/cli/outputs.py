"""Checks of output paths, and readers of files that several commands use.

Rules for every output of a command, checked before it reads or computes:

- An existing file, or a folder with files, needs ``--overwrite``. It replaces files of the same
  names and keeps the others.
- An input is never overwritten, not even with ``--overwrite``.
- The folder of an output file must exist. An output folder is made, with its parents.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.io.atomic import holds_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import asterism as am

__all__ = [
    "Folder",
    "check_ending",
    "check_outputs",
    "read_labels",
    "read_model",
    "truth_of_each",
]

_MARKS_CLUTTER = ("c3d", "csv")  # formats in which Asterism marks clutter


@dataclass(frozen=True)
class Folder:
    """Output folder of a command.

    Parameters
    ----------
    path : Path
        Path of the folder.
    names : tuple of str
        Names of the files that are written into it.
    """

    path: Path
    names: tuple[str, ...] = ()


def check_outputs(
    outputs: Mapping[str, Path | Folder | None],
    inputs: Iterable[Path | None],
    *,
    overwrite: bool,
) -> None:
    """Raise unless every output can be written to its path.

    Parameters
    ----------
    outputs : mapping
        Output files and folders by option.
    inputs : iterable
        Input files.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    ParameterError
        If an output cannot be written; the error names its option.
    """
    seen = {_identity(file): f"the input {file}" for path in inputs for file in _files_of(path)}
    for option, output in outputs.items():
        if output is None:
            continue
        is_folder = isinstance(output, Folder)
        written = {option: output.path if is_folder else output}
        if is_folder:
            written |= {f"{option} ({name})": output.path / name for name in output.names}
        for place, path in written.items():
            identity = _identity(path)
            if identity in seen:
                raise ParameterError(place, "a path of its own", f"{path}, {seen[identity]}")
            seen[identity] = f"also the path of {place}"
        if is_folder:
            _check_folder(option, output.path, overwrite=overwrite)
        else:
            _check_file(option, output, overwrite=overwrite)


def _files_of(path: Path | None) -> list[Path]:
    """Return an input and, if it is a folder, its files, any of which may be read."""
    if path is None:
        return []
    return [path, *(sorted(path.iterdir()) if path.is_dir() else ())]


def _check_file(option: str, path: Path, *, overwrite: bool) -> None:
    if path.is_dir():
        raise ParameterError(option, "a file", f"the folder {path}")
    if path.exists() and not path.is_file():
        return  # a device or a pipe, which has nothing to replace
    parent = path.resolve().parent
    if not parent.is_dir():
        raise ParameterError(option, "a file in a folder that exists", path)
    _check_access(option, path, parent)
    if path.is_file() and not overwrite:
        hint = "give --overwrite to replace it"
        raise ParameterError(option, "a new file", f"{path}, which exists", hint)


def _check_folder(option: str, path: Path, *, overwrite: bool) -> None:
    if path.exists() and not path.is_dir():
        raise ParameterError(option, "a folder or a new name", f"the file {path}")
    if path.is_dir() and holds_files(path) and not overwrite:
        hint = "give --overwrite to replace files of the same names"
        raise ParameterError(option, "a new or an empty folder", f"{path}, which holds files", hint)
    there = path.resolve()
    while not there.exists():
        there = there.parent
    if not there.is_dir():
        raise ParameterError(option, "a folder whose parents are folders", f"{path}, inside a file")
    _check_access(option, path, there)


def _check_access(option: str, path: Path, folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        got = f"{path}, without permission to write in {folder}"
        raise ParameterError(option, "a writable path", got)


def check_ending(option: str, path: Path | None, *suffixes: str) -> None:
    """Raise if the name of an output file has another ending than its format.

    Parameters
    ----------
    option : str
        Option of the file.
    path : Path or None
        The file; None if it is not written.
    *suffixes : str
        Allowed suffixes in lower case. The message lists the first.

    Raises
    ------
    ParameterError
        If the ending is none of them.
    """
    if path is not None and path.suffix.lower() not in suffixes:
        raise ParameterError(option, f"a name ending in {suffixes[0]}", str(path))


def _identity(path: Path) -> object:
    """Return a key that is equal for paths of the same file, through links too."""
    if path.exists() and path.is_file():
        status = path.stat()
        return status.st_dev, status.st_ino
    return path.resolve()


def read_model(path: Path) -> am.TrackingModel:
    """Read a tracking model from TOML.

    Raises
    ------
    FormatError
        If the file cannot be read, or is not a tracking model.
    """
    import asterism as am

    return am.TrackingModel.from_toml(path)


def read_labels(path: Path) -> am.Tracks:
    """Read tracks; among named tracks, unnamed ones are clutter if the format cannot mark it."""
    import numpy as np

    import asterism as am

    tracks = am.io.read_tracks(path)
    has_name = np.array([name is not None for name in tracks.names], dtype=bool)
    source = tracks.detections
    says_so = isinstance(source, am.Capture) and source.format in _MARKS_CLUTTER
    if says_so or not has_name.any():
        return tracks
    number = np.append(np.where(has_name, np.arange(len(has_name)), -1), -1)
    return am.Tracks(detections=source, labels=number[tracks.labels], names=tracks.names)


def truth_of_each(tracks: am.Tracks, truth: am.Tracks) -> am.Tracks:
    """Return the true tracks in the order of the detections of `tracks`.

    The order of detections differs between file formats.

    Raises
    ------
    ParameterError
        If the two are not of the same capture.
    """
    import numpy as np

    import asterism as am
    from asterism.metrics import align

    both = align(tracks, truth)
    is_ours = both.i_tracks >= 0
    labels = np.full(tracks.detections.n_points, -1)
    labels[both.i_tracks[is_ours]] = both.truth_labels[is_ours]
    return am.Tracks(detections=tracks.detections, labels=labels, names=truth.names)
