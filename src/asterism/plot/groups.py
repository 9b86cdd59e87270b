"""Groups of tracks that compete for detections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.filter import GateGroups
from asterism.plot.style import GRADIENT, GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_groups"]

ALONE = "#D4D4D4"  # tracks without a competitor
# Smallest number of tracks in a group of each colour.
_SIZES = {1: "1 track", 2: "2", 3: "3 to 4", 5: "5 to 8", 9: "9 or more"}


def plot_groups(groups: GateGroups, ax: Axes | None = None) -> Axes:
    """Draw the number of tracks in gate groups of each size, over time.

    Parameters
    ----------
    groups : GateGroups
        Result of `gate_groups`: tracks with common gated detections. A track alone in its group
        has no competitor; larger groups have more possible associations.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Time in seconds, and tracks stacked by the size of their group: the largest groups at the
        bottom and darkest, single tracks grey.

    Raises
    ------
    ParameterError
        If `groups` is not a `GateGroups`.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> groups = am.filter.gate_groups(truth, am.estimate_model(truth.detections).model)
    >>> am.plot.plot_groups(groups).get_ylabel()
    'tracks'
    """
    import matplotlib

    check_kind("groups", groups, GateGroups, "am.filter.gate_groups(tracks, model)")
    axes: Any = ax if ax is not None else new_axes(height=4.0)
    T = len(groups.times)
    least = np.array(list(_SIZES))
    size = np.searchsorted(least, groups.n_tracks, side="right") - 1
    used = int(size.max(initial=0)) + 1
    counts = np.zeros((len(least), T))
    np.add.at(counts, (size, groups.frames), groups.n_tracks)
    graded = matplotlib.colormaps[GRADIENT](np.linspace(0.85, 0.05, len(least) - 1))
    colours = [ALONE, *map(tuple, graded)]
    base = np.zeros(T)
    for i in range(used - 1, -1, -1):
        top = base + counts[i]
        axes.fill_between(
            groups.times, base, top, step="mid", color=colours[i], linewidth=0,
            label=list(_SIZES.values())[i],
        )  # fmt: skip
        base = top
    axes.set_ylim(0, max(1.05 * base.max(initial=0), 1.0))
    if T:
        axes.set_xlim(groups.times[0], groups.times[-1] if T > 1 else groups.times[0] + 1)
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("time [s]", color=INK)
    axes.set_ylabel("tracks", color=INK)
    axes.grid(axis="x", color=GRID, linewidth=0.8)
    tidy(axes)
    axes.legend(
        *(part[::-1] for part in axes.get_legend_handles_labels()), title="tracks in the group",
        loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8, title_fontsize=8,
        labelcolor=INK,
    )  # fmt: skip
    n = int(groups.n_tracks.sum())
    alone = 100 * groups.n_tracks[groups.n_tracks == 1].sum() / max(n, 1)
    most = int(groups.n_tracks.max(initial=0))
    title = f"{alone:.3g} % of the tracks alone, at most {most} in a group" if n else "no tracks"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes
