"""Paths of tracks side by side, as the report draws them: tracks beyond the eighth in brown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.plot.style import CLUTTER, CYCLE, INK

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    import asterism as am

__all__ = ["draw_paths"]

BROWN = "#8C510A"
N_KNOWN = 8
WIDTH, HEIGHT = 2.9, 3.0


def draw_paths(
    shown: Mapping[str, am.Tracks],
    under: Sequence[str] = (),
    *,
    n_known: int = N_KNOWN,
    columns: int = 4,
) -> Figure:
    """Draw tracks in space, a panel each.

    Parameters
    ----------
    shown : mapping of str to Tracks
        By their titles.
    under : sequence of str
        A second line below each title; the number of tracks unless given.
    n_known : int
        The longest so many tracks have colours of their own, all others are brown.
    columns : int
        Panels in a row.
    """
    from matplotlib.figure import Figure

    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(WIDTH * min(columns, len(shown)), HEIGHT * rows), dpi=110)
    for i, (title, tracks) in enumerate(shown.items()):
        axes: Any = figure.add_subplot(rows, min(columns, len(shown)), i + 1, projection="3d")
        _draw(axes, tracks, n_known)
        told = under[i] if under else f"{np.count_nonzero(tracks.lengths)} tracks"
        axes.set_title(title, fontsize=9, color=INK, pad=16)
        axes.text2D(
            0.5, 1.02, told, transform=axes.transAxes, fontsize=8, color=CLUTTER, ha="center"
        )
    # 3-D axes leave wide margins, which are let run out of the picture.
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.0, top=0.86, wspace=0.0, hspace=0.2)
    return figure


def _draw(axes: Any, tracks: am.Tracks, n_known: int) -> None:
    d = tracks.detections
    clutter = d.points[tracks.labels < 0]
    axes.scatter(*clutter.T, s=3, c=CLUTTER, alpha=0.5, linewidths=0, depthshade=False)
    order, offsets = tracks.by_track
    known = set(np.argsort(-tracks.lengths, kind="stable")[:n_known].tolist())
    used = 0
    for k in range(tracks.n_tracks):
        members = order[offsets[k] : offsets[k + 1]]
        colour = BROWN
        if k in known:
            colour, used = CYCLE[used % len(CYCLE)], used + 1
        if len(members):
            axes.plot(*d.points[members].T, color=colour, linewidth=1.0)
            # The last point is marked, or who stands still would not be seen.
            axes.plot(*d.points[members[-1:]].T, "o", color=colour, markersize=2.5)
    marked = d.points[tracks.labels >= 0] if (tracks.labels >= 0).any() else d.points
    low, high = marked.min(axis=0), marked.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.12)
    axes.set_axis_off()
