"""Scores of a Monte Carlo study with their confidence intervals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from asterism.errors import ParameterError
from asterism.plot.style import CYCLE, given_axes, new_panels, tidy

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_sweep"]

_NAMES = ("scene", "corruption", "method")


def plot_sweep(
    summary: Sequence[Mapping[str, Any]],
    scores: Sequence[str] = ("idf1",),
    *,
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw the mean scores of a study with their confidence intervals.

    Parameters
    ----------
    summary : sequence of mapping
        Rows of ``Sweep.summary``. If one option is varied and its values are numbers, it is the
        horizontal axis.
    scores : sequence of str
        Scores to draw, one panel each.
    ax : sequence of Axes, optional
        Axes to draw on, one for each score. By default a new figure.

    Returns
    -------
    list of Axes

    Raises
    ------
    ParameterError
        If there is nothing to draw, or the number of axes is wrong.

    Examples
    --------
    >>> rows = [
    ...     {"scene": "cube", "corruption": "c", "method": "gnn", "corruption.missing": x,
    ...      "n": 3, "idf1": 1 - x, "idf1_low": 0.9 - x, "idf1_high": 1.1 - x}
    ...     for x in (0.1, 0.2)
    ... ]
    >>> plot_sweep(rows)[0].get_xlabel()
    'corruption.missing'
    """
    if not summary or not scores:
        raise ParameterError("summary", "rows and scores", "none")
    axes = [name for name in summary[0] if "." in name]
    is_curve = len(axes) == 1 and all(isinstance(r[axes[0]], (int, float)) for r in summary)
    n = len(scores)
    if ax is None:
        height = 3.2 if is_curve else 1.1 + 0.3 * len(summary)
        panels: list[Any] = list(new_panels(1, n, width=3.4 * n, height=height))
    else:
        panels = list(given_axes(ax, n, "figure"))
    for panel, score in zip(panels, scores, strict=True):
        if is_curve:
            _curves(panel, summary, score, axes[0], has_legend=panel is panels[0])
        else:
            _rows(panel, summary, score, axes, has_names=panel is panels[0])
        panel.set_title(score, loc="left")
        tidy(panel)
    return panels


def _label(row: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], axes: Sequence[str]) -> str:
    """Return what distinguishes a row from the others."""
    names = [name for name in _NAMES if len({each[name] for each in rows}) > 1] or ["method"]
    parts = [str(row[name]) for name in names]
    return ", ".join(parts + [f"{name.partition('.')[2]} {row[name]}" for name in axes])


def _curves(
    panel: Any, rows: Sequence[Mapping[str, Any]], score: str, axis: str, *, has_legend: bool
) -> None:
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(_label(row, rows, ()), []).append(row)
    for k, (label, members) in enumerate(groups.items()):
        members = sorted(members, key=lambda row: row[axis])
        names = (axis, score, f"{score}_low", f"{score}_high")
        x, y, low, high = ([row[name] for row in members] for name in names)
        colour = CYCLE[k % len(CYCLE)]
        panel.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
        panel.plot(x, y, color=colour, marker="o", markersize=3.5, label=label)
    panel.ticklabel_format(axis="y", useOffset=False)
    panel.set_xlabel(axis)
    if has_legend:
        panel.legend(frameon=False, fontsize=8)


def _rows(
    panel: Any,
    rows: Sequence[Mapping[str, Any]],
    score: str,
    axes: Sequence[str],
    *,
    has_names: bool,
) -> None:
    for k, row in enumerate(rows):
        low, high = row[f"{score}_low"], row[f"{score}_high"]
        if math.isfinite(low):
            panel.plot([low, high], [k, k], color=CYCLE[0], alpha=0.5, linewidth=3)
        panel.plot([row[score]], [k], color=CYCLE[0], marker="o", markersize=4.5)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.set_yticks(range(len(rows)), [_label(r, rows, axes) for r in rows] if has_names else [])
