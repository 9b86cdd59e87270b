"""Panels of the figures, and paths of tracks in the style of the report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.plot.style import CLUTTER, CYCLE, INK, new_panels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    import asterism as am

__all__ = ["draw_paths", "titled", "titled_panels"]

BROWN = "#8C510A"


def titled(axes: Axes, title: str) -> Axes:
    """Write a title above the left end of axes, and return them."""
    axes.set_title(title, fontsize=10, color=INK, loc="left")
    return axes


def titled_panels(*titles: str, width: float, height: float, n_rows: int = 1) -> list[Axes]:
    """Return a new figure with one panel for each title, row by row."""
    panels = new_panels(n_rows, len(titles) // n_rows, width=width, height=height)
    return [titled(axes, title) for axes, title in zip(panels, titles, strict=True)]


def draw_paths(shown: Mapping[str, am.Tracks], *, n_known: int = 8) -> Figure:
    """Draw tracks in space, one panel for each title.

    Parameters
    ----------
    shown : mapping of str to Tracks
        Tracks by the title of their panel.
    n_known : int
        Number of longest tracks with different colours; all others are brown.

    Returns
    -------
    Figure
        Figure of the panels.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.9 * len(shown), 3.0), dpi=110)
    for i, (title, tracks) in enumerate(shown.items()):
        axes: Any = figure.add_subplot(1, len(shown), i + 1, projection="3d")
        _draw(axes, tracks, n_known)
        axes.set_title(title, fontsize=9, color=INK, pad=16)
        axes.text2D(0.5, 1.02, f"{np.count_nonzero(tracks.lengths)} tracks", fontsize=8,
                    transform=axes.transAxes, color=CLUTTER, ha="center")  # fmt: skip
    # 3-D axes have wide margins, which may lie outside the picture.
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.0, top=0.86, wspace=0.0, hspace=0.2)
    return figure


def _draw(axes: Any, tracks: am.Tracks, n_known: int) -> None:
    points, labels = tracks.detections.points, tracks.labels
    axes.scatter(*points[labels < 0].T, s=3, c=CLUTTER, alpha=0.5, linewidths=0, depthshade=False)
    known = np.sort(np.argsort(-tracks.lengths, kind="stable")[:n_known]).tolist()
    colours = {k: CYCLE[i % len(CYCLE)] for i, k in enumerate(known)}
    for k in np.flatnonzero(tracks.lengths).tolist():
        path, colour = points[labels == k], colours.get(k, BROWN)
        axes.plot(*path.T, color=colour, linewidth=1.0)
        # The last point is marked, because a marker at rest has no visible path.
        axes.plot(*path[-1:].T, "o", color=colour, markersize=2.5)
    shown = points[labels >= 0] if (labels >= 0).any() else points
    low, high = shown.min(axis=0), shown.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.12)
    axes.set_axis_off()
