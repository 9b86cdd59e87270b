"""Report page of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from asterism.reporting import report

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.batch.summary import Summary
    from asterism.tracking import ModelEstimate, Tracked

__all__ = ["flat", "write_page"]


def write_page(
    result: Tracked,
    page: Path,
    estimate: ModelEstimate | None,
    summary: Summary,
    *,
    timed: bool = True,
) -> None:
    """Write the report page of a run, with the method, its figures and the model.

    Parameters
    ----------
    result : Tracked
        Result of the run.
    page : Path
        Page to write.
    estimate : ModelEstimate or None
        Estimate of the model; None if it was given.
    summary : Summary
        Figures of the run.
    timed : bool
        Whether the page states the running time, which differs from run to run.
    """
    recipe, estimate = result.recipe, result.estimate or estimate
    stitched = ", then stitched" if recipe.stitch else ""
    options = ", ".join(f"{name}={value}" for name, value in flat(recipe.options).items())
    rows = [("method", recipe.method + stitched)]
    rows += [("method selected", recipe.chosen)] if recipe.chosen else []
    rows += [("options", options)] if options else []
    rows += [row for row in summary.rows() if timed or row[0] not in ("time", "written")]
    time = f" in {summary.seconds:.2g} s ({summary.frames_per_second:,.0f} frames a second)"
    made = f"Tracked with {recipe.method}{stitched + ',' * recipe.stitch}{time * timed}. "
    if estimate is None:
        rows.append(("model", "given, not estimated"))
        made += "The model was given."
    else:
        rows += [(f"model: {name}", f"{value}: {why}") for name, value, why in estimate.reasons]
        name, value, _ = estimate.reasons[0]
        rest = " without the motion that most markers have in common" * recipe.common_motion
        made += f"The model was estimated from the capture{rest} ({name} {value}; "
        made += "the others are below)."
    report(result.tracks, page, naming=result.naming, made=made, summary=rows)


def flat(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options with tables as dotted names."""
    made: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            inner = flat(cast("Mapping[str, Any]", value))
            made |= {f"{name}.{key}": each for key, each in inner.items()}
        else:
            made[name] = value
    return made
