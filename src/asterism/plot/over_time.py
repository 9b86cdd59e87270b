"""Coordinates of the tracks over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Tracks
from asterism.plot.colours import add_legend, colours_of
from asterism.plot.style import CLUTTER, GRID, INK, given_axes, new_panels, tidy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

__all__ = ["plot_axes"]

_MANY = 5000  # dots beyond which a vector file holds them as one image


def plot_axes(
    tracks: Tracks, ax: Sequence[Axes] | None = None, *, segments: ArrayLike | None = None
) -> list[Axes]:
    """Draw each coordinate of every track over time, and clutter as grey dots.

    Parameters
    ----------
    tracks : Tracks
        D coordinates, 2 or 3. A line is interrupted at a gap, and a detection between two gaps is
        a dot. `Tracks.select` and `Tracks.part` choose markers and frames.
    ax : sequence of D Axes, optional
        Axes to draw on; by default a new figure with one panel for each coordinate.
    segments : array_like of int, shape (K,), optional
        Rigid segment of each track, -1 for none, as `Bonds.segments` returns: the tracks of a
        segment have one colour. By default each track has a colour; seven differ.

    Returns
    -------
    list of Axes
        Seconds across; x, y and z in metres.

    Raises
    ------
    ParameterError
        If there are not as many axes as coordinates, or not one segment for each track.

    Examples
    --------
    >>> import asterism as am
    >>> panels = am.plot.plot_axes(am.simulate.cube(frames=20, seed=1))
    >>> [axes.get_ylabel() for axes in panels]
    ['x [m]', 'y [m]', 'z [m]']
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    d = tracks.detections
    D = d.n_axes
    if ax is None:
        panels: list[Any] = list(new_panels(D, width=10.0, height=1.2 + 1.9 * D))
    else:
        panels = list(given_axes(ax, D, "coordinate"))
    is_clutter = tracks.labels < 0
    order, offsets = tracks.by_track
    colours, entries = colours_of(tracks, segments)
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
            colour = colours[k]
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
    add_legend(panels[0], entries, beside=ax is None)
    panels[-1].set_xlabel("time [s]", color=INK)
    title = f"tracks: {np.count_nonzero(tracks.lengths)}, clutter: {np.count_nonzero(is_clutter)}"
    panels[0].set_title(title, fontsize=11, color=INK, loc="left")
    return panels
