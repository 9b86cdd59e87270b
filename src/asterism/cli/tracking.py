"""Track a capture by a recipe, and write the result and the run folder."""

from __future__ import annotations

import logging
import time
from typing import TYPE_CHECKING

import asterism as am
from asterism.checks import check_fields
from asterism.cli.console import progress, to_json
from asterism.cli.naming import read_markers
from asterism.cli.run_folder import CONFIG, DECISIONS, SUMMARY, writing_log
from asterism.cli.summary import Summary, summarize
from asterism.errors import ParameterError
from asterism.io.atomic import write_text
from asterism.io.decisions import write_decisions

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.cli.run_folder import Run

__all__ = ["carry_out", "default_output", "output_format"]

log = logging.getLogger(__name__)

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
        for f in am.io.CAPTURE_FORMATS.values()
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
    suffixes = am.io.CAPTURE_FORMATS[format].extensions
    ending = source.suffix if source.suffix.lower() in suffixes else suffixes[0]
    return source.with_name(f"{source.stem}.tracked{ending}")


def carry_out(
    run: Run, capture: am.Capture, out: Path, folder: Path | None
) -> tuple[am.tracking.Tracked, Summary]:
    """Track a capture, and write the result and the files of the run.

    Parameters
    ----------
    run : Run
        Recipe and format.
    capture : Capture
        Capture of the run.
    out : Path
        File of the result.
    folder : Path or None
        Existing folder for the files of the run; None for no such files.

    Returns
    -------
    Tracked, Summary
    """
    if folder is None:
        return _carry_out(run, capture, out)
    with writing_log(folder):
        run.write(folder / CONFIG)
        result, summary = _carry_out(run, capture, out)
        for name in DECISIONS:
            write_decisions(result.tracks, folder / name)
        write_text(folder / SUMMARY, to_json(summary.to_dict()) + "\n")
        return result, summary


def _carry_out(run: Run, capture: am.Capture, out: Path) -> tuple[am.tracking.Tracked, Summary]:
    recipe = run.recipe
    for warning in capture.warnings:
        log.info("%s: %s", capture.path, warning)
    if recipe.chosen:
        log.info("method selected: %s", recipe.chosen)
    log.info(
        "tracking %s (%d frames) with %s %s",
        capture.path, capture.n_frames, recipe.method, recipe.options,
    )  # fmt: skip
    method = am.tracking.method_by_name(recipe.method, **recipe.options)
    method.init(recipe.model, n_axes=capture.n_axes)  # loads the engine before the time is measured
    start = time.perf_counter()
    with progress(f"tracking with {recipe.method}", capture.n_frames) as advance:
        result = am.tracking.carry_out(
            recipe, capture, progress=advance,
            start=capture.tracks if recipe.has_start else None,
            marker_sets=[read_markers(path) for path in run.markers],
            edits=[edit for path in run.edits for edit in am.io.read_edits(path, capture)],
        )  # fmt: skip
        tracks = result.tracks
    seconds = time.perf_counter() - start
    if capture.n_points and not tracks.n_tracks:
        log.warning(
            "%s: no track was confirmed, so that all points are clutter. Check the model (asterism "
            "estimate) and the unit of length.",
            capture.path,
        )
    am.write(tracks, out, format=run.format)
    summary = summarize(result, out=out, method=recipe.method, seconds=seconds)
    for name, text in summary.rows():
        log.info("%s %s", name, text)
    return result, summary
