"""Paths of the tracks in the plane or in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Tracks
from asterism.plot.colours import add_legend, colours_of
from asterism.plot.space import to_scale
from asterism.plot.style import CLUTTER, CYCLE, GRADIENT, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

__all__ = ["plot_trajectories"]

_MANY = 5000  # dots or lines beyond which a vector file holds them as one image


def plot_trajectories(
    tracks: Tracks, ax: Axes | None = None, *, segments: ArrayLike | None = None
) -> Axes:
    """Draw the path of every track, and clutter as grey dots.

    Up to seven tracks have a colour each and a legend. More are coloured by segment, or by time
    where no segments are given.

    Parameters
    ----------
    tracks : Tracks
        2-D or 3-D; a path is interrupted at a gap. `Tracks.select` and `Tracks.part` choose markers
        and frames.
    ax : Axes, optional
        Axes to draw on, three-dimensional for 3-D tracks. By default a new figure.
    segments : array_like of int, shape (K,), optional
        Rigid segment of each track, -1 for none, as `Bonds.segments` returns.

    Returns
    -------
    Axes
        Metres on all axes, to one scale. A dot marks the last detection of each track.

    Raises
    ------
    ParameterError
        If there is not one segment for each track.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1).part(0, 50)
    >>> axes = am.plot.plot_trajectories(truth.select(["LKNE", "RKNE"]))
    >>> [text.get_text() for text in axes.figure.legends[0].get_texts()]
    ['LKNE', 'RKNE']
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    d = tracks.detections
    is_solid = d.n_axes == 3
    axes: Any = ax if ax is not None else new_axes(solid=is_solid, height=7.0)
    clutter = d.points[tracks.labels < 0]
    if len(clutter):
        axes.scatter(
            *clutter.T, s=5, c=CLUTTER, alpha=0.6, linewidths=0, label="clutter",
            rasterized=len(clutter) > _MANY,
        )  # fmt: skip
    n_there = int(np.count_nonzero(tracks.lengths))
    if segments is None and n_there > len(CYCLE):
        _draw_by_time(axes, tracks, is_solid)
    else:
        colours, entries = colours_of(tracks, segments)
        for k, points, holes in _paths(tracks):
            path = np.insert(points, holes, np.nan, axis=0)
            axes.plot(*path.T, color=colours[k], linewidth=1.0)
            axes.plot(*points[-1:].T, color=colours[k], marker="o", markersize=3.5, ls="none")
        add_legend(axes, entries, beside=ax is None)
    _to_scale(axes, d.points, is_solid)
    axes.set_title(
        f"tracks: {n_there}, clutter: {len(clutter)}", fontsize=11, color=INK, loc="left"
    )
    return axes


def _paths(tracks: Tracks) -> list[tuple[int, NDArray[np.float64], NDArray[np.int64]]]:
    """Return number, points and the indices after gaps of each track that has detections."""
    order, offsets = tracks.by_track
    d = tracks.detections
    found: list[tuple[int, NDArray[np.float64], NDArray[np.int64]]] = []
    for k in np.flatnonzero(tracks.lengths).tolist():
        members = order[offsets[k] : offsets[k + 1]]
        holes = np.flatnonzero(np.diff(d.frame_of[members]) > 1) + 1
        found.append((k, d.points[members], holes))
    return found


def _draw_by_time(axes: Any, tracks: Tracks, is_solid: bool) -> None:
    """Draw every path in the colours of its times, with a colour bar."""
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    d = tracks.detections
    order, _ = tracks.by_track
    frames, labels = d.frame_of[order], tracks.labels[order]
    joins = np.flatnonzero((np.diff(labels) == 0) & (np.diff(frames) == 1))
    lines: Any = np.stack([d.points[order[joins]], d.points[order[joins + 1]]], axis=1)
    collection = (Line3DCollection if is_solid else LineCollection)(
        lines, array=d.times[frames[joins]], cmap=GRADIENT, linewidths=1.0,
        rasterized=len(lines) > _MANY,
    )  # fmt: skip
    (axes.add_collection3d if is_solid else axes.add_collection)(collection)
    last = np.array([points[-1] for _, points, _ in _paths(tracks)])
    axes.plot(*last.T, color=INK, marker="o", markersize=2.5, linestyle="none")
    bar = axes.figure.colorbar(collection, ax=axes, shrink=0.6, aspect=30, pad=0.02)
    bar.set_label("time [s]", color=INK)
    bar.ax.tick_params(colors=INK, labelsize=8)


def _to_scale(axes: Any, points: NDArray[np.float64], is_solid: bool) -> None:
    if is_solid:
        to_scale(axes, points)
        return
    for name in "xy":
        getattr(axes, f"set_{name}label")(f"{name} [m]", color=INK)
    axes.set_aspect("equal", adjustable="datalim")
    tidy(axes)
