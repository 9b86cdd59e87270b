"""Methods beside each other: how often they are right, and what that costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError, check_array, check_fields
from asterism.view.style import CYCLE, GRID, INK, given_axes, new_axes, new_panels, tidy

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from asterism.evaluate import Evaluation

__all__ = ["plot_compare", "plot_posterior"]


def plot_compare(
    scores: Mapping[str, Evaluation],
    *,
    milliseconds: Mapping[str, float] | None = None,
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw the scores of several trackings of one capture as bars, the first on top.

    Parameters
    ----------
    scores : mapping of str to Evaluation
        From `asterism.evaluate`, by the name of each tracking.
    milliseconds : mapping of str to float, optional
        Time that each took a frame, where it is known.
    ax : sequence of Axes, optional
        Where to draw: two, or three with `milliseconds`; a new figure unless given.

    Returns
    -------
    list of Axes
        IDF1, switches and, where it is known of any, milliseconds a frame on a log scale.

    Raises
    ------
    ParameterError
        If there is nothing to compare, a time is of nobody or not above zero, or there are not as
        many axes as figures.
    """
    if not scores:
        raise ParameterError("scores", "at least one", "none")
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
        told = ["–" if np.isnan(x) else f"{x:.3g}" for x in ms]
        bars.append(("milliseconds a frame", ms, told))
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
        else:
            axes.set_xlim(0, max(1.25 * known.max(), 1.25 if i == 0 else 1))
            axes.xaxis.get_major_locator().set_params(integer=i == 1, nbins=5)
        axes.barh(rows, np.maximum(known - left, 0), 0.66, left=left, color=CYCLE[i])
        for row, value, text in zip(rows, known, texts, strict=True):
            axes.annotate(
                text, (max(value, left), row), xytext=(4, 0), textcoords="offset points",
                va="center", fontsize=8, color=INK,
            )  # fmt: skip
        axes.set_title(title, fontsize=11, color=INK, loc="left")
    return panels


def plot_posterior(
    moves: ArrayLike,
    values: ArrayLike,
    *,
    others: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw how far a Markov chain climbs with the number of its moves.

    Parameters
    ----------
    moves : array_like, shape (M,)
        Moves for each detection in doubt, as `MCMCDA` counts them; rising, the first may be 0.
    values : array_like, shape (M,) or (R, M)
        Log posterior of what was found, nats above “everything is clutter”, for each number of
        moves and each of R seeds; not finite where the model forbids it, which is left out.
    others : mapping of str to float, optional
        Log posterior of what other methods found, each drawn as a dashed line.
    ax : Axes, optional
        Where to draw; a new figure unless given.

    Returns
    -------
    Axes
        Every seed as a pale line, their mean as a strong one, nats over moves on a log scale. The
        title says how far the mean is below the best that is known.

    Raises
    ------
    ParameterError
        If the arrays do not fit each other, or the moves do not rise.
    """
    n = check_array("moves", moves, ("M",))
    if not len(n) or n[0] < 0 or (np.diff(n) <= 0).any():
        raise ParameterError("moves", "rising numbers ≥ 0, at least one", n.tolist())
    given = np.atleast_2d(np.asarray(values, dtype=np.float64))
    found = check_array("values", given, ("R", len(n)), finite=False)
    found = np.where(np.isfinite(found), found, np.nan)
    is_known = np.isfinite(found).all(axis=0)
    mean = np.full(len(n), np.nan)
    mean[is_known] = found[:, is_known].mean(axis=0)
    axes: Any = ax if ax is not None else new_axes(height=4.5)
    for row in found if len(found) > 1 else []:
        axes.plot(n, row, color=CYCLE[0], linewidth=0.8, alpha=0.35, label="_nolegend_")
    label = "mcmcda" if len(found) == 1 else f"mcmcda, mean of {len(found)} seeds"
    axes.plot(n, mean, "o-", color=CYCLE[0], linewidth=1.6, markersize=4, label=label)
    for i, (name, value) in enumerate((others or {}).items()):
        colour = CYCLE[1 + i % (len(CYCLE) - 1)]
        axes.axhline(value, color=colour, linewidth=1.2, linestyle="--", label=name)
    some = n[n > 0]
    axes.set_xscale("symlog", linthresh=float(some[0]) if len(some) else 1.0, linscale=0.6)
    # The numbers that were tried, instead of powers of ten.
    axes.set_xticks(n, [f"{x:g}" for x in n])
    axes.minorticks_off()
    axes.set_xlabel("moves for each detection in doubt", color=INK)
    axes.set_ylabel("log posterior [nats]", color=INK)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.grid(color=GRID, linewidth=0.8)
    tidy(axes)
    axes.legend(loc="lower right", frameon=False, fontsize=8, labelcolor=INK)
    best = max([*found[np.isfinite(found)].tolist(), *(others or {}).values()], default=np.nan)
    title = "no tracks that the model allows"
    if np.isfinite(mean[-1]):
        title = f"{best - mean[-1]:.3g} nats below the best known after {n[-1]:g} moves"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes
