"""Figures of a film: images of a frame, the rig, and its coverage."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.model import Detections, Tracks
from asterism.simulate import Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from asterism.camera import Rig, Surface

__all__ = ["contact_sheet", "coverage_picture", "rig_picture"]

_MAX_FRAMES = 400  # of the paths in a figure
_DOT = 9  # square points
_CELLS = 64  # of a level of the volume along its longer side
_AROUND = 0.1  # margin of the level around markers and cameras, as a share of its extent


def contact_sheet(truth: Tracks, rig: Rig, t: int, title: str) -> Figure:
    """Draw the images of all cameras in frame `t`, side by side.

    Parameters
    ----------
    truth : Tracks
        Tracks in 3-D; a marker has the same colour in all images.
    rig : Rig
        The cameras.
    t : int
        Index of the frame.
    title : str
        Title above the images.

    Notes
    -----
    The images are those of ideal cameras, without noise and false points.
    """
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure

    from asterism.plot import plot_image
    from asterism.plot.style import CYCLE, INK

    d = truth.detections
    rows = np.arange(d.offsets[t], d.offsets[t + 1])
    rows = rows[truth.labels[rows] >= 0]
    rows = rows[np.argsort(truth.labels[rows])]
    shown = truth.labels[rows]
    surfaces: tuple[Surface, ...] = ()
    connections = None
    colours = [CYCLE[k % len(CYCLE)] for k in shown.tolist()]
    if isinstance(truth, Truth):
        surfaces = tuple(s.during(np.array([t])) for s in truth.surfaces)
        connections = truth.connections[np.ix_(shown, shown)]
        if connections.any():
            colours = [CYCLE[(k - 1) % len(CYCLE)] for k in truth.colours[shown].tolist()]
    projection = rig.project(d.points[rows], surfaces)
    n_columns = math.ceil(math.sqrt(len(rig)))
    n_rows = math.ceil(len(rig) / n_columns)
    width = min(max(15.0 / n_columns, 1.8), 7.0)
    height = width * float(np.median([c.size_px[1] / c.size_px[0] for c in rig])) + 0.35
    figure = Figure(
        figsize=(width * n_columns, height * n_rows + 0.4), layout="constrained", dpi=100
    )
    figure.suptitle(title, fontsize=11, color=INK, x=0.01, ha="left", parse_math=False)
    for i, camera in enumerate(rig):
        axes = figure.add_subplot(n_rows, n_columns, i + 1)
        named = camera.replace(name=rig.names[i])
        plot_image(
            named,
            projection[i],
            connections=connections,
            colours=colours,
            surfaces=surfaces,
            ax=axes,
        )
        is_near = _near(axes, projection[i].pixels, camera.size_px)
        text = axes.get_title(loc="left") + (", a part of the image" if is_near else "")
        axes.set_title(text, fontsize=8, loc="left", parse_math=False)
        axes.set(xlabel="", ylabel="")
        axes.tick_params(labelsize=6)
        for dots in axes.collections:
            if isinstance(dots, PathCollection):
                dots.set(sizes=[_DOT])
    return figure


def _near(axes: Any, pixels: NDArray[np.float64], size_px: tuple[int, int]) -> bool:
    """Zoom to the points if they fill a small part of the image; return whether it was zoomed."""
    size = np.array(size_px)
    inside = ((pixels > 0) & (pixels < size)).all(axis=1)
    if not inside.any():
        return False
    low, high = pixels[inside].min(axis=0), pixels[inside].max(axis=0)
    half = size * max(0.65 * float(((high - low) / size).max()), 0.02)
    if half[0] > 0.35 * size[0]:
        return False
    (u, v), (du, dv) = (low + high) / 2, half
    axes.set(xlim=(u - du, u + du), ylim=(v + dv, v - dv))
    return True


def rig_picture(truth: Tracks, rig: Rig) -> Figure:
    """Draw the cameras, and the paths of the markers between them."""
    from asterism.plot import plot_rig, plot_trajectories
    from asterism.plot.style import INK, new_axes

    axes: Any = new_axes(solid=True, height=6.5)
    plot_trajectories(_thinned(truth), ax=axes)
    plot_rig(rig, ax=axes)
    title = f"{len(rig)} cameras, {np.count_nonzero(truth.lengths)} tracks"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes.figure


def coverage_picture(truth: Tracks, rig: Rig) -> Figure:
    """Draw the coverage of the horizontal level through the middle of the markers."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle
    from matplotlib.patheffects import withStroke

    from asterism.camera import volume_grid
    from asterism.plot import plot_coverage
    from asterism.plot.style import INK, WRONG

    points = truth.detections.points[truth.labels >= 0]
    low, high = points.min(axis=0), points.max(axis=0)
    places = np.stack([camera.center for camera in rig])
    first, last = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
    side = max(float((last - first)[:2].max()), 0.1)
    first, last = first - _AROUND * side, last + _AROUND * side
    first[2] = last[2] = (low[2] + high[2]) / 2
    coverage = rig.coverage(volume_grid(first, last, (1 + 2 * _AROUND) * side / _CELLS))
    among = rig.coverage(volume_grid(low, high, max(float((high - low).max()), 1e-3) / 12))
    known = 1e3 * among.error[np.isfinite(among.error)]
    error = f"median error {np.median(known):.3g} mm" if known.size else "no error known"
    level = f"z = {first[2]:.3g} m"
    titles = {
        "cameras": f"{level}, among the markers: {100 * (among.n_cameras >= 2).mean():.3g} % of "
        "the places seen by two or more",
        "error": f"{level}, among the markers: {error}",
    }
    shape = (last - first)[1] / (last - first)[0]
    figure = Figure(figsize=(14, min(max(5.5 * shape + 1, 3), 9)), layout="constrained", dpi=110)
    for axes, what in zip(figure.subplots(1, 2), ("cameras", "error"), strict=True):
        plot_coverage(coverage, what=what, ax=axes)
        axes.set_title(titles[what], fontsize=11, color=INK, loc="left")
        box = Rectangle(
            (low[0], low[1]), high[0] - low[0], high[1] - low[1], fill=False, edgecolor=WRONG,
            linewidth=1.6, label="markers",
        )  # fmt: skip
        axes.add_patch(box)
        dots = axes.scatter(*places[:, :2].T, s=24, c=INK, edgecolors="white", label="cameras")
        for name, place in zip(rig.names, places, strict=True):
            axes.annotate(
                name, place[:2], xytext=(4, 3), textcoords="offset points", fontsize=7, color=INK,
                parse_math=False, path_effects=[withStroke(linewidth=2, foreground="white")],
            )  # fmt: skip
        axes.legend(
            handles=[box, dots], loc="upper left", bbox_to_anchor=(0, -0.1), ncols=2, fontsize=8,
            frameon=False, labelcolor=INK,
        )  # fmt: skip
    return figure


def _thinned(truth: Tracks) -> Tracks:
    """Return a long capture with evenly spaced frames, without clutter."""
    d = truth.detections
    every = 1 + (d.n_frames - 1) // _MAX_FRAMES
    is_kept = (d.frame_of % every == 0) & (truth.labels >= 0)
    times = d.times[::every]
    counts = np.bincount(d.frame_of[is_kept] // every, minlength=len(times))
    kept = Detections(
        times=times,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        points=d.points[is_kept],
    )
    return Tracks(detections=kept, labels=truth.labels[is_kept], names=truth.names)
