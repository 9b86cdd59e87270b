"""The pages of `field.py`: who wins where, growth, a table for each kind, and every clip."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from field_growth import growth_table
from field_rows import NOT_RUN, ORACLES, OURS
from field_verdict import verdict
from peers import PEERS
from report import conditions, table

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from field_rows import Found, Score

__all__ = ["pages"]

REFERENCE = "Stone Soup GNN"
LABEL = {**dict.fromkeys(PEERS, "{}"), **dict.fromkeys(OURS, "**{}**")}


def label(name: str) -> str:
    """Give a tracker's name, ours in bold and the oracles in italics."""
    return LABEL.get(name, "*{}*").format(name)


def mean(values: Sequence[float], form: str) -> str:
    known = [v for v in values if not np.isnan(v)]
    return form.format(float(np.mean(known))) if known else "–"


def ran(scores: Sequence[Score]) -> list[Score]:
    return [s for s in scores if s.error != NOT_RUN]


def idf1(scores: Sequence[Score]) -> str:
    done = ran(scores)
    errors = [s.error for s in done if s.error]
    if not done:
        return NOT_RUN
    if len(errors) == len(done):
        return "–"
    value = f"{np.mean([s.idf1 for s in done]):.3f}"
    notes = [f"{len(errors)} failed"] if errors else []
    if len(done) < len(scores):  # no mean to hold against the others
        notes.append(f"{len(done)} of {len(scores)}")
    return f"{value} ({', '.join(notes)})" if notes else value


def against(scores: Sequence[Score], reference: Sequence[Score], *, is_whole: bool) -> str:
    """Give the geometric mean of the times of the same clips, the reference's over these."""
    theirs = {s.clip: s.ms for s in reference if not s.error}
    ratios: list[float] = []
    for s in scores:
        if not s.error and s.clip in theirs and s.ms > 0:
            before = 1e3 * s.prepared / s.frames if is_whole and s.trials is None else 0.0
            ratios.append(theirs[s.clip] / (s.ms + before))
    if not ratios:
        return "–"
    value = float(np.exp(np.mean(np.log(ratios))))
    return f"{value:,.0f}" if value >= 10 else f"{value:.1f}"


def of_kind(kind: str, found: Found) -> list[str]:
    names = [name for k, name in found if k == kind]
    most = max((len(ran(found[kind, name])) for name in names), default=0)
    rows: list[list[str]] = []
    for name in names:
        scores = ran(found[kind, name])
        if not scores:
            continue
        some = f" ({len(scores)} clips)" if len(scores) < most else ""
        done = [s for s in scores if not s.error]
        if not done:
            rows.append([label(name) + some, scores[0].error, *[""] * 8])
            continue
        reference = found.get((kind, REFERENCE), [])
        is_oracle = name in ORACLES
        ratio = against(done, reference, is_whole=False)
        whole = against(done, reference, is_whole=True)
        rows.append([
            label(name) + some, idf1(scores), mean([s.switches for s in done], "{:.1f}"),
            f"{np.mean([s.wrong for s in done]):.0f}, {np.mean([s.broken for s in done]):.0f}",
            mean([s.tracks_per_true for s in done], "{:.2f}"),
            mean([s.ms for s in done], "{:.2f}"),
            ratio if ratio == whole else f"{ratio} ({whole})",
            mean([s.megabytes for s in done], "{:.0f}"),
            "–" if done[0].trials is None else str(min(s.trials or 0 for s in done)),
            "–" if is_oracle else mean([s.prepared for s in done], "{:.1f}"),
        ])  # fmt: skip
    head = [
        "", "IDF1", "switches a 1000", "links wrong, broken", "tracks/true", "ms a frame",
        "× as fast as Stone Soup GNN", "memory, MB", "trials", "prepared in, s",
    ]  # fmt: skip
    return [f"**{kind}**, {most} clips:", "", *table(head, rows), ""] if rows else []


def of_clips(kinds: Sequence[str], found: Found) -> list[str]:
    """Return the IDF1 on every capture: a table of the peers, and one of the oracles and ours.

    One table of all trackers would be wider than the page. The best of both is bold.
    """
    names = list(dict.fromkeys(name for _, name in found))
    parts = [[n for n in names if n in PEERS], [n for n in names if n not in PEERS]]
    rows: list[list[list[str]]] = [[] for _ in parts]
    for kind in kinds:
        for i, first in enumerate(found[kind, names[0]]):
            scores = {name: found[kind, name][i] for name in names}
            title = f"{first.clip}, {max(s.points for s in scores.values()):,} points"
            best = max(s.idf1 for n, s in scores.items() if n not in ORACLES)
            cells: dict[str, str] = {}
            for name, s in scores.items():
                value = "–" if s.error else f"{s.idf1:.3f}"
                is_best = name not in ORACLES and not s.error and s.idf1 >= best - 5e-4
                cells[name] = (
                    f"**{value}**" if is_best else NOT_RUN if s.error == NOT_RUN else value
                )
            for part, some in zip(parts, rows, strict=True):
                some.append([title, *(cells[name] for name in part)])
    tables = (table(["", *part], some) for part, some in zip(parts, rows, strict=True) if part)
    return [line for lines in tables for line in (*lines, "")][:-1]


def how(found: Found, options: argparse.Namespace) -> str:
    """Say what was run, so that no figure stands alone."""
    clips = {s.clip for scores in found.values() for s in ran(scores)}
    return (
        f"Each peer tuned by {options.trials} settings, fewer where {options.budget:g} s of CPU "
        f"time were used up, on up to {options.tuning_frames} frames a clip; {len(clips)} clips, "
        f"at most {options.frames} frames each; a run of more than {options.limit:g} s is ended. "
        f"Ours (bold): nothing tuned. {conditions()}; one core of a machine that did other work, "
        "CPU time."
    )


def pages(found: Found, options: argparse.Namespace) -> dict[str, list[str]]:
    """Give the lines of each page by its name."""
    kinds = list(
        dict.fromkeys(k for (k, n), rows in found.items() if n not in ORACLES and ran(rows))
    )
    names = list(dict.fromkeys(name for _, name in found))
    made = how(found, options)
    scenes = [kind for kind in kinds if not kind.startswith("captures")]
    files = [kind for kind in kinds if kind.startswith("captures")]
    given: dict[str, list[str]] = {"field": [made, "", *verdict(kinds, found)]}
    for page, some in (("field_scenes", scenes), ("field_captures", files)):
        head = ["", *(kind.removeprefix("captures, ") for kind in some)]
        rows = [[label(n), *(idf1(found[k, n]) for k in some)] for n in names]
        lines = ["Mean IDF1. A clip that failed counts as 0; – where all of a kind failed:", ""]
        lines += [*table(head, rows), ""]
        for kind in some:
            lines += of_kind(kind, found)
        if some:
            given[page] = lines
    growing: list[Any] = [kind for kind in kinds if kind.startswith("dense")]
    if growing:
        given["field_growth"] = growth_table(growing, found)
    given["field_clips"] = of_clips(kinds, found)
    return given
