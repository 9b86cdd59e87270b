"""Rows of tracks over time, and a strip of figures by frame above them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Tracks
from asterism.plot.style import GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["axes_for", "frame_rows", "legend_above", "rows_of", "strip_above"]

_MAX_NAMES = 120  # rows with legible names on the highest figure


def rows_of(tracks: Tracks) -> NDArray[np.int64]:
    """Return the row of each track by first frame, shape (K,); -1 without detections."""
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    order, offsets = tracks.by_track
    there = np.flatnonzero(tracks.lengths)
    first = tracks.detections.frame_of[order[offsets[there]]]
    rows = np.full(tracks.n_tracks, -1)
    rows[there[np.argsort(first, kind="stable")]] = np.arange(len(there))
    return rows


def axes_for(rows: NDArray[np.int64]) -> Axes:
    """Return new axes that are high enough for the rows."""
    return new_axes(height=float(np.clip(2.0 + 0.16 * (rows.max(initial=0) + 1), 3.5, 20.0)))


def frame_rows(axes: Any, tracks: Tracks, rows: NDArray[np.int64]) -> None:
    """Set the times of a capture, the names of its tracks and the style on axes."""
    d = tracks.detections
    n_rows = int(rows.max(initial=-1)) + 1
    axes.set_ylim(n_rows - 0.3, -0.7)
    if d.n_frames:
        half = d.step / 2 or 0.5
        axes.set_xlim(d.times[0] - half, d.times[-1] + half)
    axes.set_xlabel("time [s]", color=INK)
    axes.grid(axis="x", color=GRID, linewidth=0.8)
    tidy(axes)
    if n_rows <= _MAX_NAMES:
        there = np.flatnonzero(rows >= 0)
        names = [tracks.names[k] or f"{k}" for k in there]
        axes.set_yticks(rows[there], names, fontsize=7, parse_math=False)
        axes.tick_params(axis="y", length=0)
    axes.set_ylabel("track, by first frame", color=INK)


def strip_above(axes: Any, says: str = "") -> Any:
    """Return axes above others, over the same times, of the same height in every figure.

    Parameters
    ----------
    axes : Axes
        Axes below. Their title stays free for the caller.
    says : str
        Result in words, above the strip.

    Returns
    -------
    Axes
        Axes of the strip.
    """
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    # The position is relative to the axes below in width, and in inches from their upper edge, so
    # that it holds for any later layout and in a subfigure.
    inches = axes.figure.dpi_scale_trans + ScaledTranslation(0, 1, axes.transAxes)
    place = blended_transform_factory(axes.transAxes, inches)
    above = axes.inset_axes((0.0, 0.1, 1.0, 0.55), transform=place, sharex=axes)
    tidy(above)
    above.tick_params(axis="x", labelbottom=False, length=0)
    above.tick_params(axis="y", labelsize=7)
    above.yaxis.get_major_locator().set_params(integer=True, nbins=2)
    # A label and not a title, because matplotlib would lift the title of the axes below over it.
    above.xaxis.set_label_position("top")
    above.set_xlabel(says, fontsize=11, color=INK, loc="left", labelpad=5)
    return above


def legend_above(strip: Any) -> None:
    """Add the legend of a strip on its right, no higher than the strip."""
    strip.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, fontsize=8,
        labelcolor=INK, handlelength=1.2, borderpad=0, borderaxespad=0.5,
    )  # fmt: skip
