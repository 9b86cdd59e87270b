"""Convergence of a Markov chain over partitions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_array
from asterism.errors import ParameterError
from asterism.plot.style import CYCLE, GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

__all__ = ["plot_posterior"]


def plot_posterior(
    moves: ArrayLike,
    values: ArrayLike,
    *,
    others: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the log posterior of a Markov chain over the number of its moves.

    Parameters
    ----------
    moves : array_like of shape (M,)
        Moves per ambiguous detection, as `MCMCDA` counts them, increasing; the first may be 0.
    values : array_like of shape (M,) or (R, M)
        Log posterior of the result in nats above “everything is clutter”, for each number of moves
        and each of R seeds. Values that are not finite are left out.
    others : mapping of str to float, optional
        Log posterior of other methods by name, each drawn as a dashed line.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Nats below the best drawn value over moves, on a scale that is logarithmic above 1: each
        seed as a pale line, their mean as a strong one. The title has the final mean.

    Raises
    ------
    ParameterError
        If the shapes do not agree, or the moves do not increase.

    Examples
    --------
    >>> import asterism as am
    >>> axes = am.plot.plot_posterior([1, 10], [[90.0, 99.0], [92.0, 100.0]], others={"gnn": 80.0})
    >>> axes.get_xlabel()
    'moves per ambiguous detection'
    """
    n = check_array("moves", moves, ("M",))
    if not len(n) or n[0] < 0 or (np.diff(n) <= 0).any():
        raise ParameterError("moves", "rising numbers ≥ 0, at least one", n.tolist())
    given = np.atleast_2d(np.asarray(values, dtype=np.float64))
    found = check_array("values", given, ("R", len(n)), finite=False)
    found = np.where(np.isfinite(found), found, np.nan)
    lines = {k: v for k, v in (others or {}).items() if np.isfinite(v)}
    best = max([*found[np.isfinite(found)].tolist(), *lines.values()], default=0.0)
    below = found - best
    mean = below.mean(axis=0)  # NaN where one of the seeds is: they would not be comparable
    axes: Any = ax if ax is not None else new_axes(height=4.5)
    for row in below if len(below) > 1 else []:
        axes.plot(n, row, color=CYCLE[0], linewidth=0.8, alpha=0.4, label="_nolegend_")
    label = "mcmcda" if len(below) == 1 else f"mcmcda, mean of {len(below)} seeds"
    axes.plot(n, mean, "o-", color=CYCLE[0], linewidth=1.6, markersize=4, label=label)
    for i, (name, value) in enumerate(lines.items()):
        colour = CYCLE[1 + i % (len(CYCLE) - 1)]
        axes.axhline(value - best, color=colour, linewidth=1.2, linestyle="--", label=name)
    some = n[n > 0]
    axes.set_xscale("symlog", linthresh=float(some[0]) if len(some) else 1.0, linscale=0.6)
    axes.set_xlim(left=0 if n[0] == 0 else 0.9 * n[0], right=1.1 * max(n[-1], 1.0))
    # The numbers that were tried, instead of powers of ten.
    axes.set_xticks(n, [f"{x:g}" for x in n])
    axes.minorticks_off()
    depth = -np.nanmin([*below[np.isfinite(below)], *(v - best for v in lines.values()), 0.0])
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_ylim(-2 * max(depth, 1.0), 0.3)
    decades = 10.0 ** np.arange(np.ceil(np.log10(max(2 * depth, 1.0))) + 1)
    ticks = [0.0, *(-decades[decades <= 2 * max(depth, 1.0)]).tolist()]
    axes.set_yticks(ticks, [f"{abs(tick):g}" for tick in ticks])
    axes.set_xlabel("moves per ambiguous detection", color=INK)
    axes.set_ylabel("nats below the best known", color=INK)
    axes.grid(color=GRID, linewidth=0.8)
    tidy(axes)
    legend = axes.legend(loc="lower right", frameon=False, fontsize=8, labelcolor=INK)
    for text in legend.get_texts():
        text.set_parse_math(False)
    title = "the model forbids a track of some seed"
    if np.isfinite(mean[-1]):
        title = f"after {n[-1]:g} moves {abs(mean[-1]):.2f} nats below the best known"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes
