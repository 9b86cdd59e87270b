"""How sure each track is of its labels, and whether that means what it says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.plot.coverage import draw_bar
from asterism.plot.rows import axes_for, frame_rows, legend_above, rows_of, strip_above
from asterism.plot.style import CLUTTER, CYCLE, GRADIENT, GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from asterism.metrics import CalibrationCurve

__all__ = ["plot_confidence", "plot_identity", "plot_reliability"]

_MANY = 20_000  # cells beyond which a vector file holds them as one image


def plot_confidence(tracks: Tracks, ax: Axes | None = None) -> Axes:
    """Draw each track as a bar over time, shaded by the confidence of each link.

    The confidence of a label is that of the link from the previous detection. Light shades stand
    for a low confidence.

    Parameters
    ----------
    tracks : Tracks
        Tracks with a confidence. Bars are in the order of `plot_presence`, interrupted by gaps.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Time in seconds and one row per track, with a colour bar. An inset above has the mean and
        the lowest confidence of the links into each frame.

    Raises
    ------
    ParameterError
        If the tracks have no confidence.

    Examples
    --------
    >>> import asterism as am
    >>> tracks = am.track(am.simulate.cube(frames=10, seed=1).detections, "jpda")
    >>> am.plot.plot_confidence(tracks).get_xlabel()
    'time [s]'
    """
    return _bars(tracks, "confidence", "a link", "links", ax)


def plot_identity(tracks: Tracks, ax: Axes | None = None) -> Axes:
    """Draw each track as a bar over time, shaded by the confidence of its identity.

    The confidence of an identity is the probability that a detection is of the marker that holds
    most of its track. Light shades stand for a low confidence.

    Parameters
    ----------
    tracks : Tracks
        Tracks with a confidence of identity. Bars are in the order of `plot_presence`, interrupted
        by gaps.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        As of `plot_confidence`, with the mean and the lowest confidence of each frame above.

    Raises
    ------
    ParameterError
        If the tracks have no confidence of identity.

    Examples
    --------
    >>> import asterism as am
    >>> tracks = am.track(am.simulate.cube(frames=10, seed=1).detections)
    >>> am.plot.plot_identity(tracks).get_xlabel()
    'time [s]'
    """
    return _bars(tracks, "identity_confidence", "an identity", "identities", ax)


def _bars(tracks: Tracks, field: str, one: str, many: str, ax: Axes | None) -> Axes:
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    confidence: NDArray[np.float64] | None = getattr(tracks, field)
    if confidence is None:
        hint = "am.track returns it; of the files a CSV keeps it"
        raise ParameterError("tracks", f"tracks with a confidence of {many}", "none", hint)
    d = tracks.detections
    rows = rows_of(tracks)
    axes: Any = ax if ax is not None else axes_for(rows)
    order, _ = tracks.by_track
    row, frame = rows[tracks.labels[order]], d.frame_of[order]
    sure = confidence[order]
    if len(order):
        cells = np.full((int(row.max()) + 1, d.n_frames), np.nan)
        cells[row, frame] = sure
        drawn = axes.pcolormesh(
            _edges(d.times), np.arange(len(cells) + 1) - 0.5, np.ma.masked_invalid(cells),
            cmap=f"{GRADIENT}_r", vmin=0, vmax=1, rasterized=cells.size > _MANY,
        )  # fmt: skip
        draw_bar(axes, drawn, f"confidence of {one}", ticks=np.linspace(0, 1, 6))
        # White between the rows, so that neighbours do not run into each other.
        for edge in np.arange(1, len(cells)) - 0.5:
            axes.axhline(edge, color="white", linewidth=2.0)
    frame_rows(axes, tracks, rows)
    axes.grid(visible=False)
    title = f"confidence of {many}, mean {sure.mean():.3f}" if len(sure) else f"no {many}"
    above = strip_above(axes, title)
    n = np.bincount(frame, minlength=d.n_frames)
    total = np.bincount(frame, weights=sure, minlength=d.n_frames)
    mean = np.divide(total, n, out=np.full(d.n_frames, np.nan), where=n > 0)
    least = np.full(d.n_frames, np.inf)
    np.minimum.at(least, frame, sure)
    least[n == 0] = np.nan
    above.plot(d.times, least, color=CYCLE[1], linewidth=0.8, label="lowest")
    above.plot(d.times, mean, color=CYCLE[0], linewidth=1.2, label="mean")
    above.set_ylim(-0.03, 1.05)
    legend_above(above)
    return axes


def plot_reliability(
    calibration: CalibrationCurve | Mapping[str, CalibrationCurve], ax: Axes | None = None
) -> Axes:
    """Draw the share of correct labels over their confidence.

    Parameters
    ----------
    calibration : CalibrationCurve, or mapping of names to them
        Result of `asterism.metrics.calibration_curve`, or several by name.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        A point at the mean confidence of each bin with labels, with Wilson's interval of one
        standard error. Points of calibrated confidence lie on the diagonal. An inset above shows
        the number of labels of each bin.

    Raises
    ------
    ParameterError
        If there is nothing to draw.

    Examples
    --------
    >>> import asterism as am
    >>> found = am.metrics.calibration_curve([0.9, 0.8, 0.2], [True, True, False])
    >>> len(am.plot.plot_reliability(found).lines) > 0
    True
    """
    parts = calibration if isinstance(calibration, Mapping) else {"": calibration}
    if not parts:
        raise ParameterError("calibration", "at least one", "none")
    for part in parts.values():
        if not hasattr(part, "ece"):  # its class is of a house that this one does not enter
            hint = "try am.metrics.calibration_curve(confidence, is_right)"
            raise ParameterError("calibration", "a CalibrationCurve", type(part).__name__, hint)
    axes: Any = ax if ax is not None else new_axes(height=6.0)
    axes.plot([0, 1], [0, 1], color=CLUTTER, linewidth=1, linestyle="--", label="as sure as right")
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    tidy(axes)
    above = strip_above(axes)
    above.set_yscale("log")
    for i, (name, part) in enumerate(parts.items()):
        colour = CYCLE[i % len(CYCLE)]
        used = part.counts > 0
        share, n = part.right[used], part.counts[used]
        prefix = f"{name}: " if name else ""
        low, high = _interval(share, n)
        axes.errorbar(
            part.confidence[used], share, yerr=(share - low, high - share), marker="o",
            markersize=4, linewidth=1.0, color=colour, label=f"{prefix}error {part.ece:.3f}",
        )  # fmt: skip
        above.stairs(part.counts, part.edges, color=colour, linewidth=1.2)
    above.set_ylim(bottom=0.5)
    above.set_ylabel("labels", fontsize=8, color=INK)
    above.grid(axis="y", color=GRID, linewidth=0.8)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_xlabel("confidence", color=INK)
    axes.set_ylabel("share that is right", color=INK)
    legend = axes.legend(loc="best", frameon=False, fontsize=8, labelcolor=INK)
    for text in legend.get_texts():
        text.set_parse_math(False)
    return axes


def _interval(
    share: NDArray[np.float64], n: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of Wilson's interval of one standard error about shares of `n`."""
    middle = (share + 0.5 / n) / (1 + 1 / n)
    half = np.sqrt(share * (1 - share) / n + 0.25 / n**2) / (1 + 1 / n)
    # Rounding must not put the share itself outside.
    return np.minimum(middle - half, share), np.maximum(middle + half, share)


def _edges(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the borders between frames, shape (T + 1,), half way between their times."""
    if len(times) == 1:
        return np.array([times[0] - 0.5, times[0] + 0.5])
    middle = (times[1:] + times[:-1]) / 2
    return np.concatenate([[2 * times[0] - middle[0]], middle, [2 * times[-1] - middle[-1]]])
