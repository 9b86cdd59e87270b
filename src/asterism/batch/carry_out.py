"""Carry out a run: track a capture, and write the result and the files of the run."""

from __future__ import annotations

import dataclasses
import logging
import time
from typing import TYPE_CHECKING

from asterism.batch.run_folder import CONFIG, DECISIONS, SUMMARY, writing_log
from asterism.batch.summary import summarize
from asterism.io import write
from asterism.io.atomic import write_text
from asterism.io.decisions import write_decisions
from asterism.io.json_text import to_json
from asterism.tracking import carry_out as track_by_recipe
from asterism.tracking import method_by_name

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from typing import Any

    from asterism.batch.run_folder import Run
    from asterism.batch.summary import Summary
    from asterism.model import Capture, Edit, MarkerSet
    from asterism.tracking import Tracked

__all__ = ["carry_out"]

log = logging.getLogger(__name__)


def carry_out(
    run: Run,
    capture: Capture,
    out: Path,
    *,
    folder: Path | None = None,
    marker_sets: Sequence[MarkerSet] | None = None,
    edits: Sequence[Edit] = (),
    progress: Callable[[int], Any] | None = None,
) -> tuple[Tracked, Summary]:
    """Track a capture by the recipe of a run, and write the tracks.

    Parameters
    ----------
    run : Run
        Recipe and format.
    capture : Capture
        Capture of the run.
    out : Path
        File of the result.
    folder : Path, optional
        Existing folder for the files of the run; the summary is written last. By default no such
        files are written.
    marker_sets : sequence of MarkerSet, optional
        Marker sets of the run.
    edits : sequence of Edit
        Edits of the run.
    progress : callable, optional
        Called from time to time with the number of finished frames.

    Returns
    -------
    Tracked, Summary
    """
    if folder is None:
        return _carry_out(run, capture, out, marker_sets, edits, progress)
    with writing_log(folder):
        run.write(folder / CONFIG)
        result, summary = _carry_out(run, capture, out, marker_sets, edits, progress)
        dataclasses.replace(run, recipe=result.recipe).write(folder / CONFIG)
        for name in DECISIONS:
            write_decisions(result.tracks, folder / name)
        write_text(folder / SUMMARY, to_json(summary.to_dict()) + "\n")
        return result, summary


def _carry_out(
    run: Run,
    capture: Capture,
    out: Path,
    marker_sets: Sequence[MarkerSet] | None,
    edits: Sequence[Edit],
    progress: Callable[[int], Any] | None,
) -> tuple[Tracked, Summary]:
    recipe = run.recipe
    for warning in capture.warnings:
        log.info("%s: %s", capture.path, warning)
    if recipe.chosen:
        log.info("method selected: %s", recipe.chosen)
    log.info(
        "tracking %s (%d frames) with %s %s",
        capture.path, capture.n_frames, recipe.method, recipe.options,
    )  # fmt: skip
    method = method_by_name(recipe.method, **recipe.options)
    method.init(recipe.model, n_axes=capture.n_axes)  # loads the engine before the time is measured
    start = time.perf_counter()
    result = track_by_recipe(
        recipe, capture, progress=progress, marker_sets=marker_sets, edits=edits,
        start=capture.tracks if recipe.has_start else None,
    )  # fmt: skip
    tracks = result.tracks
    if result.recipe.method != recipe.method:
        log.info("method selected: %s", result.recipe.chosen)
    seconds = time.perf_counter() - start
    if capture.n_points and not tracks.n_tracks:
        log.warning(
            "%s: no track was confirmed, so that all points are clutter. Check the model (asterism "
            "estimate) and the unit of length.",
            capture.path,
        )
    write(tracks, out, format=run.format)
    summary = summarize(
        result, out=out, method=result.recipe.method, seconds=seconds, n_edits=len(edits)
    )
    for name, text in summary.rows():
        log.info("%s %s", name, text)
    return result, summary
