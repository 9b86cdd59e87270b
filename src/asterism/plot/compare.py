"""Methods beside each other: how often they are right, and what that costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_fields, check_kind
from asterism.errors import ParameterError
from asterism.plot.style import CYCLE, GRID, INK, given_axes, new_panels, tidy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from asterism.metrics import Evaluation

__all__ = ["plot_compare"]


def plot_compare(
    scores: Mapping[str, Evaluation],
    *,
    milliseconds: Mapping[str, float] | None = None,
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw the scores of several results for one capture as bars.

    Parameters
    ----------
    scores : mapping of str to Evaluation
        Scores by the name of each result, drawn from top to bottom.
    milliseconds : mapping of str to float, optional
        Running time per frame by the same names, > 0; names without a time are allowed.
    ax : sequence of Axes, optional
        Two axes to draw on, or three with `milliseconds`. By default a new figure.

    Returns
    -------
    list of Axes
        IDF1, identity switches and, with `milliseconds`, the time per frame on a log scale.

    Raises
    ------
    ParameterError
        If `scores` is empty or holds other values, if a time has another name or is not above
        zero, or if the number of axes is wrong.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> scores = {"gnn": am.evaluate(am.track(truth.detections, "gnn"), truth)}
    >>> [axes.get_title(loc="left") for axes in am.plot.plot_compare(scores)]
    ['IDF1, 1 is best', 'identity switches']
    """
    hint = '{"a name": am.evaluate(tracks, truth)}'
    check_kind("scores", scores, Mapping, hint)
    if not scores:
        raise ParameterError("scores", "at least one", "none")
    for name, score in scores.items():
        if not hasattr(score, "idf1"):  # plot does not import metrics
            got = f"{type(score).__name__} of {name}"
            raise ParameterError("scores", "an Evaluation by each name", got, f"try {hint}")
    times = dict(milliseconds or {})
    check_fields("milliseconds", times, scores)
    names = list(scores)
    n = 3 if times else 2
    if ax is None:
        height = 1.1 + 0.32 * len(names)
        panels: list[Any] = list(new_panels(1, n, width=3.4 * n, height=height))
    else:
        panels = list(given_axes(ax, n, "figure"))
    rows = np.arange(len(names))
    idf1 = [scores[name].idf1 for name in names]
    switches = [scores[name].switches for name in names]
    bars = [
        ("IDF1, 1 is best", idf1, [f"{x:.4f}" for x in idf1]),
        ("identity switches", switches, [str(x) for x in switches]),
    ]
    if times:
        for name, ms in times.items():
            if not ms > 0:
                raise ParameterError("milliseconds", "times above 0", f"{ms} of {name}")
        ms = [times.get(name, np.nan) for name in names]
        shown = ["–" if np.isnan(x) else f"{x:.3g}" for x in ms]
        bars.append(("milliseconds a frame", ms, shown))
    for i, (axes, (title, values, texts)) in enumerate(zip(panels, bars, strict=True)):
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_yticks(rows, names if i == 0 else [""] * len(names), fontsize=9, parse_math=False)
        axes.grid(axis="x", color=GRID, linewidth=0.8)
        tidy(axes)
        axes.tick_params(axis="y", length=0)
        known = np.nan_to_num(np.asarray(values, dtype=np.float64))
        left = 0.0
        if i == 2:
            axes.set_xscale("log")
            least = min(x for x in known if x > 0)
            left = 10 ** (np.floor(np.log10(least)) - 0.3)
            axes.set_xlim(left, 6 * known.max())
        elif i == 1:
            axes.set_xlim(0, max(1.3 * known.max(), 1))
            axes.xaxis.get_major_locator().set_params(integer=True, nbins=5)
        else:
            axes.set_xlim(0, 1.3)
            axes.set_xticks([0, 0.5, 1])
        axes.barh(rows, np.maximum(known - left, 0), 0.66, left=left, color=CYCLE[i])
        for row, value, text in zip(rows, known, texts, strict=True):
            axes.annotate(
                text, (max(value, left), row), xytext=(4, 0), textcoords="offset points",
                va="center", fontsize=8, color=INK,
            )  # fmt: skip
        axes.set_title(title, fontsize=11, color=INK, loc="left")
    return panels
