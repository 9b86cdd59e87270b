"""Where commands may write, and the files that several of them read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.errors import FormatError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import asterism as am

__all__ = ["check_ending", "check_outputs", "read_labels", "read_model", "truth_of_each"]

_MARKS_CLUTTER = ("c3d", "csv")  # as Asterism writes them


def check_outputs(outputs: Mapping[str, Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise before any work if a file would be written that is read, two into one, or nowhere.

    Parameters
    ----------
    outputs : mapping
        Files to write, by the option that names them.
    inputs : iterable
        Files that are read.

    Raises
    ------
    ParameterError
        With the option at fault.
    """
    seen = {_identity(path): f"the input {path}" for path in inputs if path is not None}
    for option, path in outputs.items():
        if path is None:
            continue
        identity = _identity(path)
        if identity in seen:
            raise ParameterError(option, "a file of its own", f"{path}, {seen[identity]}")
        seen[identity] = f"which {option} names too"
        if not path.resolve().parent.is_dir():
            raise ParameterError(option, "a file in a folder that exists", path)


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

    try:
        return am.TrackingModel.from_toml(path)
    except OSError as error:
        raise FormatError(path, "opening", "a model in TOML", error.strerror) from error


def read_labels(path: Path) -> am.Tracks:
    """Read tracks; unnamed ones among named ones are clutter where the format cannot say so."""
    import numpy as np

    import asterism as am

    tracks = am.read_tracks(path)
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
    from asterism.evaluate import align

    both = align(tracks, truth)
    is_ours = both.i_tracks >= 0
    labels = np.full(tracks.detections.n_points, -1)
    labels[both.i_tracks[is_ours]] = both.truth_labels[is_ours]
    return am.Tracks(detections=tracks.detections, labels=labels, names=truth.names)
