"""Presence of each track over time, and its wrong labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.plot.rows import axes_for, frame_rows, legend_above, rows_of, strip_above
from asterism.plot.style import CLUTTER, CYCLE, INK, MISSED, RIGHT, WRONG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_errors", "plot_presence"]


def plot_presence(tracks: Tracks, ax: Axes | None = None) -> Axes:
    """Draw each track as a bar over time, with the clutter per frame above.

    Parameters
    ----------
    tracks : Tracks
        Tracks, drawn from top to bottom in the order of their first frames. Gaps interrupt a bar.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Time in seconds and one row per track; an inset above has the counts.

    Examples
    --------
    >>> import asterism as am
    >>> axes = am.plot.plot_presence(am.simulate.cube(frames=20, seed=1))
    >>> axes.get_xlabel()
    'time [s]'
    """
    rows = rows_of(tracks)
    axes = ax if ax is not None else axes_for(rows)
    order, _ = tracks.by_track
    colours = np.array(CYCLE, dtype=object)[tracks.labels[order] % len(CYCLE)]
    _draw_bars(axes, tracks, rows, colours)
    above = strip_above(axes, f"{len(np.unique(tracks.labels[order]))} tracks over time")
    _draw_counts(above, tracks, tracks.labels < 0, CLUTTER)
    above.set_ylabel("clutter", fontsize=8, color=INK)
    return axes


def plot_errors(tracks: Tracks, truth: Tracks, ax: Axes | None = None) -> Axes:
    """Draw each track as a bar over time, with wrong labels in another colour.

    The right marker of a track is its most frequent one. The counts above are detections with a
    wrong label, and detections of markers without a label.

    Parameters
    ----------
    tracks : Tracks
        Tracks to check.
    truth : Tracks
        True tracks of the same detections in the same order; label -1 is clutter.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Time in seconds and one row per track, sorted by first frame; an inset above has the counts.

    Raises
    ------
    ParameterError
        If `tracks` and `truth` have different detections.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.crossing(frames=20, seed=1)
    >>> tracks = am.track(truth.detections, "gnn")
    >>> len(am.plot.plot_errors(tracks, truth).child_axes)
    1
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("truth", truth, Tracks)
    a, b = tracks.detections, truth.detections
    if a is not b and not (
        np.array_equal(a.offsets, b.offsets) and np.array_equal(a.points, b.points)
    ):
        raise ParameterError(
            "truth", f"labels of the same {a.n_points} detections", f"{b.n_points} others",
            "use am.metrics.align, which finds the same detections in two captures",
        )  # fmt: skip
    marker_of = _commonest_marker(tracks, truth)
    is_labelled = tracks.labels >= 0
    is_right = np.zeros(a.n_points, dtype=bool)
    is_right[is_labelled] = (marker_of[tracks.labels[is_labelled]] == truth.labels[is_labelled]) & (
        truth.labels[is_labelled] >= 0
    )
    rows = rows_of(tracks)
    axes = ax if ax is not None else axes_for(rows)
    order, _ = tracks.by_track
    _draw_bars(axes, tracks, rows, np.where(is_right[order], RIGHT, WRONG).astype(object))
    is_wrong = is_labelled & ~is_right
    share = 100 * is_wrong.sum() / max(int(is_labelled.sum()), 1)
    above = strip_above(axes, f"{share:.2g} % of the labels wrong")
    is_missed = ~is_labelled & (truth.labels >= 0)
    _draw_counts(above, tracks, is_wrong | is_missed, MISSED, "no label")
    _draw_counts(above, tracks, is_wrong, WRONG, "wrong marker")
    above.plot([], [], color=RIGHT, linewidth=4, label="right marker")
    legend_above(above)
    above.set_ylabel("errors", fontsize=8, color=INK)
    return axes


def _commonest_marker(tracks: Tracks, truth: Tracks) -> NDArray[np.int64]:
    """Marker that each track has most often, the lowest of several; -2 for a track of clutter."""
    both = (tracks.labels >= 0) & (truth.labels >= 0)
    n_markers = max(truth.n_tracks, 1)
    pairs, counts = np.unique(
        tracks.labels[both] * n_markers + truth.labels[both], return_counts=True
    )
    commonest = np.full(tracks.n_tracks, -2)
    rising = np.lexsort((-pairs, counts))  # the last one written stays
    commonest[pairs[rising] // n_markers] = pairs[rising] % n_markers
    return commonest


def _draw_bars(
    axes: Any, tracks: Tracks, rows: NDArray[np.int64], colours: NDArray[np.object_]
) -> None:
    """Draw one rectangle for each run of frames in which a track is there in one colour."""
    from matplotlib.collections import PolyCollection

    d = tracks.detections
    order, _ = tracks.by_track
    track, frame = tracks.labels[order], d.frame_of[order]
    goes_on = (np.diff(track) == 0) & (np.diff(frame) == 1) & (colours[1:] == colours[:-1])
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = ~goes_on
    begins = np.flatnonzero(is_first)
    ends = np.append(begins[1:], len(order))[: len(begins)] - 1
    half = d.step / 2 or 0.5
    left, right = d.times[frame[begins]] - half, d.times[frame[ends]] + half
    row = rows[track[begins]]
    low, high = row - 0.36, row + 0.36
    corners = np.stack([left, low, left, high, right, high, right, low], axis=1).reshape(-1, 4, 2)
    # A hair of an edge, so that a single frame of a long capture can still be seen.
    bars = PolyCollection(
        list(corners), facecolors=colours[begins].tolist(), edgecolors="face", linewidths=0.25
    )
    axes.add_collection(bars)
    frame_rows(axes, tracks, rows)


def _draw_counts(
    axes: Any, tracks: Tracks, is_counted: NDArray[np.bool_], colour: str, label: str = ""
) -> None:
    d = tracks.detections
    counts = np.bincount(d.frame_of[is_counted], minlength=d.n_frames)
    axes.fill_between(
        d.times, counts, step="mid", color=colour, linewidth=0, label=label or "_nolegend_"
    )
    axes.set_ylim(0, max(1.0, 1.08 * counts.max(initial=0), axes.get_ylim()[1]))
