"""Marker sets from files: a file of a marker set, or a labelled capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.io import CAPTURE_FORMATS, read, read_marker_set
from asterism.io.captures.marker_names import is_unlabelled
from asterism.tracking.naming.learn import learn_marker_set

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import MarkerSet, Tracks

__all__ = ["labelled_tracks", "read_markers"]


def read_markers(path: Path, *, option: str = "--markers") -> MarkerSet:
    """Read a marker set, or learn that of a labelled capture; errors name the `option`."""
    suffixes = [e for f in CAPTURE_FORMATS.values() for e in f.extensions]
    if path.name.lower().endswith(tuple(e for e in suffixes if e)):
        return learn_marker_set(labelled_tracks(path, None, option=option))
    return read_marker_set(path)


def labelled_tracks(path: Path, subject: str | None, *, option: str = "IN") -> Tracks:
    """Read the tracks of a labelled capture, of one subject if it is given.

    Errors name the `option` that gives the capture.
    """
    capture = read(path)
    tracks = capture.tracks.measured()
    named = [k for k, name in enumerate(tracks.names) if name and not is_unlabelled(name)]
    if subject is not None:
        named = [k for k in named if str(tracks.names[k]).startswith(f"{subject}:")]
    if not named:
        of = f" of {subject}" if subject is not None else ""
        n = tracks.n_tracks
        got = f"{n} tracks in {path}, none with a name{of}" if n else f"no tracks in {path}"
        raise ParameterError(option, f"a capture with named markers{of}", got)
    return tracks if subject is None else tracks.select(named)
