"""Where the markers were, one coordinate at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Tracks
from asterism.plot.style import CLUTTER, CYCLE, GRID, INK, given_axes, new_panels, tidy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_axes"]

_MANY = 5000  # dots beyond which a vector file holds them as one image


def plot_axes(tracks: Tracks, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """Draw each coordinate of every track over time, and clutter as grey dots.

    Parameters
    ----------
    tracks : Tracks
        D coordinates, 2 or 3; a line is broken where its track was not seen, and a detection
        between two gaps is a dot.
    ax : sequence of D Axes, optional
        Where to draw; a new figure with a panel for each unless given.

    Returns
    -------
    list of Axes
        Seconds across; x, y and z in metres.

    Raises
    ------
    ParameterError
        If there are not as many axes as coordinates.
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    d = tracks.detections
    D = d.n_axes
    if ax is None:
        panels: list[Any] = list(new_panels(D, width=8.0, height=1.2 + 1.9 * D))
    else:
        panels = list(given_axes(ax, D, "coordinate"))
    is_clutter = tracks.labels < 0
    order, offsets = tracks.by_track
    for i, axes in enumerate(panels):
        if is_clutter.any():
            axes.scatter(
                d.times[d.frame_of[is_clutter]], d.points[is_clutter, i], s=3, c=CLUTTER,
                alpha=0.6, linewidths=0, label="clutter", rasterized=is_clutter.sum() > _MANY,
            )  # fmt: skip
        for k in range(tracks.n_tracks):
            members = order[offsets[k] : offsets[k + 1]]
            if not len(members):
                continue
            frames = d.frame_of[members]
            is_hole = np.diff(frames) > 1
            holes = np.flatnonzero(is_hole) + 1
            colour = CYCLE[k % len(CYCLE)]
            x, y = d.times[frames], d.points[members, i]
            axes.plot(
                np.insert(x, holes, np.nan), np.insert(y, holes, np.nan), color=colour,
                linewidth=0.9,
            )  # fmt: skip
            alone = np.append(True, is_hole) & np.append(is_hole, True)
            if alone.any():
                axes.plot(x[alone], y[alone], ".", color=colour, markersize=3)
        axes.set_ylabel(f"{'xyz'[i]} [m]", color=INK)
        axes.grid(color=GRID, linewidth=0.8)
        tidy(axes)
        if d.n_frames:
            half = d.step / 2 or 0.5
            axes.set_xlim(d.times[0] - half, d.times[-1] + half)
        axes.tick_params(axis="x", labelbottom=i == D - 1)
    panels[-1].set_xlabel("time [s]", color=INK)
    title = f"tracks: {np.count_nonzero(tracks.lengths)}, clutter: {np.count_nonzero(is_clutter)}"
    panels[0].set_title(title, fontsize=11, color=INK, loc="left")
    return panels
