"""What ``asterism plot`` reads: tracks, the folders of runs, what kinds of figures ask of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.errors import FormatError, ParameterError, not_read

if TYPE_CHECKING:
    from collections.abc import Sequence

    import asterism as am

__all__ = [
    "is_observations",
    "model_for",
    "named",
    "solid_tracks",
    "summary_of",
    "sure_tracks",
    "tracks_of",
]


def tracks_of(path: Path) -> am.Tracks:
    """Read a tracking: a file, or the folder of a run."""
    from asterism.cli.outputs import read_labels

    return read_labels(_result(path))


def sure_tracks(path: Path) -> am.Tracks:
    """Read a tracking that has a confidence."""
    tracks = tracks_of(path)
    if tracks.confidence is None:
        hint = (
            "write one by asterism track --method mcmcda -o FILE.csv; other formats have no place"
        )
        raise ParameterError("FILES", "tracks with a confidence", f"{path}, which has none", hint)
    return tracks


def solid_tracks(path: Path) -> am.Tracks:
    """Read tracks that cameras can look at."""
    import asterism as am

    truth = am.io.read_tracks(path)
    if not (truth.labels >= 0).any():
        hint = "run asterism track first: it makes tracks of points without names"
        raise ParameterError("FILES", "points in tracks", f"{path}, which has none", hint)
    if truth.detections.n_axes != 3:
        raise ParameterError("FILES", "points in 3-D", f"{path}, in 2-D")
    return truth


def model_for(path: Path | None, detections: am.Detections) -> am.TrackingModel:
    """Read a model, or estimate it where none is given."""
    import asterism as am
    from asterism.cli.console import progress
    from asterism.cli.outputs import read_model

    if path is not None:
        return read_model(path)
    with progress("estimating the model"):
        return am.estimate_model(detections).model


def is_observations(path: Path) -> bool:
    """Tell the observations of a film, CSV by camera, from a capture in CSV."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            columns = {word.strip().lower() for word in file.readline().split(",")}
    except OSError as error:
        raise not_read(path, error) from error
    return {"camera", "u", "v"} <= columns


def summary_of(path: Path) -> dict[str, Any]:
    """Give the summary of a run folder; nothing of a mere file."""
    from asterism.cli.run_folder import SUMMARY

    if not path.is_dir():
        return {}
    hint = "make one by asterism track --run"
    try:
        found = json.loads((path / SUMMARY).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FormatError(path, SUMMARY, "a finished run", "no such file", hint) from error
    except OSError as error:
        raise not_read(path / SUMMARY, error) from error
    except ValueError as error:
        raise FormatError(path, SUMMARY, "a finished run", error, hint) from error
    if not isinstance(found, dict) or "output" not in found:
        raise FormatError(path, SUMMARY, "a finished run", "no word of its output", hint)
    return found


def _result(path: Path) -> Path:
    """Give the file that a run wrote, which lies in its folder wherever that is now."""
    return path / Path(summary_of(path)["output"]).name if path.is_dir() else path


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Name files and folders shortly, and apart."""
    found: dict[str, Path] = {}
    for path in paths:
        name = path.resolve().name if path.is_dir() else path.stem
        if name in found:
            name = str(path)
        if name in found:
            raise ParameterError("FILES", "different files", f"{path} twice")
        found[name] = path
    return found
