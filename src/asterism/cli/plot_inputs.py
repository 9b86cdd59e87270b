"""Inputs of ``asterism plot``: tracks, run folders, models and selections of tracks."""

from __future__ import annotations

import dataclasses
import json
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_fields
from asterism.errors import FormatError, ParameterError, not_read

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    import asterism as am

__all__ = [
    "confident_tracks",
    "is_observations",
    "model_for",
    "named",
    "segments_of",
    "selected",
    "solid_tracks",
    "summary_of",
    "tracks_of",
]


def tracks_of(path: Path) -> am.Tracks:
    """Read tracks from a file or the folder of a run."""
    from asterism.cli.outputs import read_labels

    return read_labels(_result(path))


def selected(
    tracks: am.Tracks, markers: Sequence[str] | None, time: tuple[float, float] | None
) -> am.Tracks:
    """Select markers, by name or else by track number, and a time window in seconds."""
    if markers is not None:
        tracks = tracks.select([k for marker in markers for k in _matching(tracks, marker)])
    if time is not None:
        times = tracks.detections.times
        first, end = np.searchsorted(times, time[0]), np.searchsorted(times, time[1], side="right")
        if first >= end:
            extent = f"{times[0]:g} to {times[-1]:g} s" if len(times) else "no frame"
            found = f"{time[0]:g} to {time[1]:g} s"
            raise ParameterError("--time", f"a part of the capture, {extent}", found)
        tracks = tracks.part(int(first), int(end))
    return tracks


def _matching(tracks: am.Tracks, marker: str) -> list[int]:
    """Return the tracks with a name that matches a pattern, or with a number."""
    names = [name or f"{k}" for k, name in enumerate(tracks.names)]
    found = [k for k, name in enumerate(names) if fnmatchcase(name, marker)]
    if not found:
        check_fields("--markers", [marker], [*names, *map(str, range(len(tracks)))])
    return found or [int(marker)]


def segments_of(tracks: am.Tracks) -> NDArray[np.int64] | None:
    """Return the rigid segment of each track, -1 for none; None where colours suffice.

    Tracks in less than a tenth of the frames are too short to have one.
    """
    import asterism as am
    from asterism.plot.style import CYCLE

    if np.count_nonzero(tracks.lengths) <= len(CYCLE):
        return None
    names = [f"{k}" for k in range(len(tracks))]
    long = np.flatnonzero(tracks.lengths >= max(0.1 * tracks.detections.n_frames, 2)).tolist()
    renamed = dataclasses.replace(tracks, names=names).select(long)
    return am.tracking.learn_bonds(renamed).segments(names)


def confident_tracks(path: Path, field: str = "confidence") -> am.Tracks:
    """Read tracks that have a confidence, of links or in `field`."""
    tracks = tracks_of(path)
    if getattr(tracks, field) is None:
        hint = "run asterism track -o FILE.csv; only CSV holds a confidence"
        raise ParameterError("FILES", "tracks with a confidence", f"{path}, which has none", hint)
    return tracks


def solid_tracks(path: Path) -> am.Tracks:
    """Read tracks in 3-D."""
    import asterism as am

    truth = am.io.read_tracks(path)
    if not (truth.labels >= 0).any():
        hint = "run asterism track first"
        raise ParameterError("FILES", "points in tracks", f"{path}, which has none", hint)
    if truth.detections.n_axes != 3:
        raise ParameterError("FILES", "points in 3-D", f"{path}, in 2-D")
    return truth


def model_for(path: Path | None, detections: am.Detections) -> am.TrackingModel:
    """Read a model, or estimate it if there is no file."""
    import asterism as am
    from asterism.cli.console import progress
    from asterism.cli.outputs import read_model

    if path is not None:
        return read_model(path)
    with progress("estimating the model"):
        return am.estimate_model(detections).model


def is_observations(path: Path) -> bool:
    """Return whether a CSV file holds image points by camera, and not a capture."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            columns = {word.strip().lower() for word in file.readline().split(",")}
    except OSError as error:
        raise not_read(path, error) from error
    return {"camera", "u", "v"} <= columns


def summary_of(path: Path) -> dict[str, Any]:
    """Return the summary of a run folder, or an empty one for a file."""
    from asterism.batch.run_folder import SUMMARY

    if not path.is_dir():
        return {}
    hint = "make one with asterism track --run"
    try:
        found = json.loads((path / SUMMARY).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FormatError(path, SUMMARY, "a finished run", "no such file", hint) from error
    except OSError as error:
        raise not_read(path / SUMMARY, error) from error
    except ValueError as error:
        raise FormatError(path, SUMMARY, "a finished run", error, hint) from error
    if not isinstance(found, dict) or "output" not in found:
        raise FormatError(path, SUMMARY, "a finished run", "no field output", hint)
    return found


def _result(path: Path) -> Path:
    """Return the result of a run, which is in its folder even if that was moved."""
    return path / Path(summary_of(path)["output"]).name if path.is_dir() else path


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Return files and folders by a short unique name."""
    found: dict[str, Path] = {}
    for path in paths:
        name = path.resolve().name if path.is_dir() else path.stem
        if name in found:
            name = str(path)
        if name in found:
            raise ParameterError("FILES", "different files", f"{path} twice")
        found[name] = path
    return found
