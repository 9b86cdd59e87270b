"""The page of `field.py`: IDF1, time by the number of markers, and a table for each kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from report import conditions, table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

__all__ = ["NOT_RUN", "page"]

NOT_RUN = "not run"

REFERENCE = "Stone Soup GNN"


def _mean(values: Sequence[float], form: str) -> str:
    known = [v for v in values if not np.isnan(v)]
    return form.format(float(np.mean(known))) if known else "–"


def _that_ran(scores: Sequence[Any]) -> list[Any]:
    return [s for s in scores if s.error != NOT_RUN]


def _idf1(scores: Sequence[Any]) -> str:
    scores = _that_ran(scores)
    errors = [s.error for s in scores if s.error]
    if not scores:
        return NOT_RUN
    if len(errors) == len(scores):
        return "–"
    value = f"{np.mean([s.idf1 for s in scores]):.3f}"
    return f"{value} ({len(errors)} failed)" if errors else value


def _against(scores: Sequence[Any], reference: Sequence[Any]) -> str:
    """Give the geometric mean of the times of the same clips, the reference's over these."""
    theirs = {s.clip: s.ms for s in reference if not s.error}
    ratios = [theirs[s.clip] / s.ms for s in scores if not s.error and s.clip in theirs and s.ms]
    return f"{np.exp(np.mean(np.log(ratios))):,.3g}" if ratios else "–"


def _of_kind(kind: str, found: Any, names: Sequence[str], ours: Sequence[str]) -> list[str]:
    rows: list[list[str]] = []
    for name in names:
        scores = _that_ran(found[kind, name])
        if not scores:
            continue
        label = f"**{name}**" if name in ours else name
        errors = list(dict.fromkeys(s.error for s in scores if s.error))
        done = [s for s in scores if not s.error]
        if not done:
            rows.append([label, errors[0], *[""] * 8])
            continue
        rows.append([
            label, _idf1(scores), _mean([s.switches for s in done], "{:.1f}"),
            _mean([s.wrong for s in done], "{:.0f}"),
            _mean([s.tracks_per_true for s in done], "{:.2f}"),
            _mean([s.ms for s in done], "{:.2f}"),
            _against(done, found.get((kind, REFERENCE), [])),
            _mean([s.megabytes for s in done], "{:.0f}"),
            "–" if done[0].trials is None else str(min(s.trials for s in done)),
            _mean([s.prepared for s in done], "{:.1f}"),
        ])  # fmt: skip
    head = [
        "", "IDF1", "switches a 1000", "wrong links", "tracks/true", "ms a frame",
        "× as fast as Stone Soup GNN", "memory, MB", "trials", "prepared in, s",
    ]  # fmt: skip
    if not rows:
        return []
    n_clips = max(len(_that_ran(found[kind, name])) for name in names)
    return [f"**{kind}**, {n_clips} clips:", "", *table(head, rows), ""]


def page(
    found: Any, names: Sequence[str], ours: Sequence[str], options: argparse.Namespace
) -> list[str]:
    """Give the lines of the page."""
    every = list(
        dict.fromkeys(
            kind for (kind, _), scores in found.items() if any(not s.error for s in scores)
        )
    )
    of = f"{options.seeds} seeds of each scene"
    if all(kind.startswith("captures") for kind in every):
        of = f"{options.files} captures of at most {options.points:,} points"
    label = {name: f"**{name}**" if name in ours else name for name in names}
    lines = [
        f"Each peer tuned by {options.trials} random settings, fewer where {options.budget:g} s of "
        f"CPU time were used up, on up to {options.tuning_frames} frames of two other clips; "
        f"{of}; at most {options.frames} frames a clip; a run of more than "
        f"{options.limit:g} s is ended. Ours (bold): nothing tuned. {conditions()}; one core, CPU "
        "time.",
        "",
        "Mean IDF1. A clip that failed counts as 0; – where all of a kind failed:",
        "",
    ]
    lines += table(["", *every], [[label[n], *(_idf1(found[k, n]) for k in every)] for n in names])
    growing = [kind for kind in every if kind.startswith("dense")]
    if growing:
        rows = [
            [label[n], *(_mean([s.ms for s in found[k, n]], "{:.2f}") for k in growing)]
            for n in names
        ]
        lines += ["", "Milliseconds a frame, by the number of markers:", ""]
        lines += table(["", *(kind.removeprefix("dense ") for kind in growing)], rows)
    lines.append("")
    for kind in every:
        lines += _of_kind(kind, found, names, ours)
    return lines
