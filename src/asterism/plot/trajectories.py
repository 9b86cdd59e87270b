"""Where the markers went."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Tracks
from asterism.plot.space import to_scale
from asterism.plot.style import CLUTTER, CYCLE, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_trajectories"]

_MANY = 5000  # dots beyond which a vector file holds them as one image


def plot_trajectories(tracks: Tracks, ax: Axes | None = None) -> Axes:
    """Draw the path of every track, and clutter as grey dots.

    Parameters
    ----------
    tracks : Tracks
        2-D or 3-D; a path is broken where its track was not seen.
    ax : Axes, optional
        Where to draw; three-dimensional for 3-D tracks. A new figure unless given.

    Returns
    -------
    Axes
        Metres on all axes, to one scale.
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
    order, offsets = tracks.by_track
    for k in range(tracks.n_tracks):
        members = order[offsets[k] : offsets[k + 1]]
        if not len(members):
            continue
        points, frames = d.points[members], d.frame_of[members]
        holes = np.flatnonzero(np.diff(frames) > 1) + 1
        path = np.insert(points, holes, np.nan, axis=0)
        colour = CYCLE[k % len(CYCLE)]
        axes.plot(*path.T, color=colour, linewidth=1.0)
        axes.plot(*points[-1:].T, color=colour, marker="o", markersize=3.5, linestyle="none")
    _to_scale(axes, d.points, is_solid)
    title = f"tracks: {np.count_nonzero(tracks.lengths)}, clutter: {len(clutter)}"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes


def _to_scale(axes: Any, points: NDArray[np.float64], is_solid: bool) -> None:
    if is_solid:
        to_scale(axes, points)
        return
    for name in "xy":
        getattr(axes, f"set_{name}label")(f"{name} [m]", color=INK)
    axes.set_aspect("equal", adjustable="datalim")
    tidy(axes)
