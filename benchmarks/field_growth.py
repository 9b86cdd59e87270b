"""How time and memory of the trackers of `field.py` grow with the number of markers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from field_rows import LATE, NOT_RUN, ORACLES, OURS
from report import table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from field_rows import Found, Score

__all__ = ["growth", "growth_table"]

DENSE = "dense "


def _time(scores: Sequence[Score], limit: bool = True) -> str:
    """Give the mean; where time ran out, what a frame took at least."""
    done = [s.ms for s in scores if not s.error]
    if done:
        return f"{np.mean(done):.2f}"
    late = [s for s in scores if limit and s.error.startswith(LATE)]
    if late:
        seconds = float(late[0].error.removeprefix(LATE).removesuffix("s"))
        return f"> {1e3 * seconds / late[0].frames:,.0f}"
    return NOT_RUN if all(s.error == NOT_RUN for s in scores) else "–"


def growth_table(kinds: Sequence[str], found: Found) -> list[str]:
    """Give milliseconds a frame and megabytes, a row for each tracker."""
    rows: list[list[str]] = []
    for name in dict.fromkeys(name for _, name in found):
        if name in ORACLES:
            continue
        cells: list[str] = [f"**{name}**" if name in OURS else name]
        cells += [_time(found[kind, name]) for kind in kinds]
        for kind in kinds:
            sizes = [s.megabytes for s in found[kind, name] if not s.error]
            cells.append(f"{np.mean(sizes):.0f}" if sizes else "–")
        rows.append(cells)
    counts = [kind.removeprefix(DENSE) for kind in kinds]
    head = ["markers", *(f"{n}: ms" for n in counts), *(f"{n}: MB" for n in counts)]
    return table(head, rows)


def growth(found: Found) -> Any:
    """Draw milliseconds a frame over the number of markers, both in powers of ten."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    ends: list[tuple[float, float, str, str]] = []
    shown = ("gnn", "smp, window=3", "mcmcda", "auto")
    for name in dict.fromkeys(name for _, name in found):
        if name in ORACLES or (name in OURS and name not in shown):
            continue
        points = [
            (int(kind.removeprefix(DENSE)), float(np.mean([s.ms for s in scores if not s.error])))
            for (kind, n), scores in found.items()
            if n == name and kind.startswith(DENSE) and any(not s.error for s in scores)
        ]
        if not points:
            continue
        x, y = zip(*points, strict=True)
        color = "#1f5fa8" if name in OURS else "#6e6e6e"
        style = "-" if name in OURS else "--"
        axes.plot(x, y, style, color=color, marker="o", markersize=4, linewidth=1.4)
        ends.append((float(x[-1]), float(y[-1]), name, color))
    _name(axes, ends)
    axes.set(xscale="log", yscale="log", xlabel="markers", ylabel="CPU time of a frame, ms")
    ticks = [50, 200, 1000]
    axes.set_xticks(ticks, [f"{n:,}" for n in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(right=4500)
    heights = [0.1, 1, 10, 100, 1000]
    axes.set_yticks(heights, [f"{h:,g}" for h in heights])
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    return figure


def _name(axes: Any, ends: list[tuple[float, float, str, str]]) -> None:
    """Write each name beside the end of its line, moved up where it would hit the one below."""
    ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}  # no line through a name
    for last in sorted({x for x, *_ in ends}):
        lowest = -np.inf
        for _, y, name, color in sorted(e for e in ends if e[0] == last):
            place = max(np.log10(y), lowest + 0.17)
            lowest = place
            axes.annotate(
                name, (last, 10**place), xytext=(7, 0), textcoords="offset points", fontsize=8,
                color=color, va="center", bbox=ground,
            )  # fmt: skip
