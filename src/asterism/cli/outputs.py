"""Where commands may write, and the files that several of them read.

The rules for every file and folder that a command writes, held before it reads or computes:

- A file or a folder with files that exists needs ``--overwrite``, which replaces files of the same
  names and leaves others.
- What is read is never written, ``--overwrite`` or not.
- A file goes into a folder that exists. A folder is made, with its parents.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from asterism.errors import ParameterError

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

_MARKS_CLUTTER = ("c3d", "csv")  # as Asterism writes them


@dataclass(frozen=True)
class Folder:
    """A folder that a command writes.

    Parameters
    ----------
    path : Path
        The folder.
    names : tuple of str
        Files that are written in it.
    """

    path: Path
    names: tuple[str, ...] = ()


def check_outputs(
    outputs: Mapping[str, Path | Folder | None],
    inputs: Iterable[Path | None],
    *,
    overwrite: bool,
) -> None:
    """Raise before any work unless everything can be written where it is asked for.

    Parameters
    ----------
    outputs : mapping
        Files and folders to write, by the option that names them.
    inputs : iterable
        Files that are read.
    overwrite : bool
        Whether what exists may be replaced.

    Raises
    ------
    ParameterError
        With the option at fault.
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
                raise ParameterError(place, "a place of its own", f"{path}, {seen[identity]}")
            seen[identity] = f"which {place} names too"
        if is_folder:
            _check_folder(option, output.path, overwrite=overwrite)
        else:
            _check_file(option, output, overwrite=overwrite)


def _files_of(path: Path | None) -> list[Path]:
    """Give an input, and of a folder the files in it: any of them may be read."""
    if path is None:
        return []
    return [path, *(sorted(path.iterdir()) if path.is_dir() else ())]


def _check_file(option: str, path: Path, *, overwrite: bool) -> None:
    if path.is_dir():
        raise ParameterError(option, "a file", f"the folder {path}")
    if path.exists() and not path.is_file():
        return  # a device or a pipe, which is written as it stands
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
    if path.is_dir() and any(path.iterdir()) and not overwrite:
        hint = "give --overwrite to replace those of the same names"
        raise ParameterError(option, "a new or an empty folder", f"{path}, which holds files", hint)
    there = path.resolve()
    while not there.exists():
        there = there.parent
    if not there.is_dir():
        raise ParameterError(option, "a folder within folders", f"{path}, within a file")
    _check_access(option, path, there)


def _check_access(option: str, path: Path, folder: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        got = f"{path}, and no permission to write in {folder}"
        raise ParameterError(option, "a place that can be written to", got)


def check_ending(option: str, path: Path | None, *endings: str) -> None:
    """Raise before any work if a file would be written under the name of something else.

    Parameters
    ----------
    option : str
        The option that names it.
    path : Path or None
        The file, if one is asked for.
    *endings : str
        What its name may end in, in small letters; the first is what the message says.

    Raises
    ------
    ParameterError
        If it ends in something else.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise ParameterError(option, f"a name ending in {endings[0]}", str(path))


def _identity(path: Path) -> object:
    """Give what two paths share if they lead to one file, by other names or links too."""
    if path.exists() and path.is_file():
        status = path.stat()
        return status.st_dev, status.st_ino
    return path.resolve()


def read_model(path: Path) -> am.TrackingModel:
    """Read a model from TOML.

    Raises
    ------
    FormatError
        If the file cannot be read, or is no model.
    """
    import asterism as am

    return am.TrackingModel.from_toml(path)


def read_labels(path: Path) -> am.Tracks:
    """Read tracks; unnamed ones among named ones are clutter where the format cannot say so."""
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
    """Give the truth of each detection of `tracks`, one by one: files have an order of their own.

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
