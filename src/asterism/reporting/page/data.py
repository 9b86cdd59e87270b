"""Data of the player, as a header and arrays."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from asterism.model import Capture
from asterism.plot.style import CLUTTER, CYCLE, MISSED, WRONG
from asterism.reporting.page.editing import numbers_of
from asterism.reporting.page.lenses import SIDE, camera_header, lens_table
from asterism.reporting.page.nearest import usual_distance
from asterism.reporting.page.packing import grid_over, packed, residuals
from asterism.reporting.page.runs import runs_of
from asterism.reporting.page.subject import subject_of
from asterism.reporting.page.thinning import thinned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, Tracks
    from asterism.reporting.page.contents import Contents

__all__ = ["Played", "played"]

_MARGIN = 0.25  # about the labelled points, for clutter
_RADIUS = 0.012  # of markers as they are drawn, metres; less where they are close


class Played(NamedTuple):
    """Data of the player, and their losses against the full data.

    Attributes
    ----------
    text : str
        Data in Base64.
    resolution : float
        Largest spacing of the grid of positions, metres.
    n_outside : int
        Number of clutter points that are too far away to be drawn.
    lens_error : float
        Largest error of a point in the image of a camera, pixels.
    """

    text: str
    resolution: float
    n_outside: int
    lens_error: float


def played(contents: Contents, order: NDArray[np.int64], shown: NDArray[np.int64]) -> Played:
    """Pack the data of the player.

    Parameters
    ----------
    contents : Contents
        Contents of the page.
    order : ndarray of int, shape (K,)
        Tracks in the order of severity, the worst first.
    shown : ndarray of int
        Frames of the player, increasing.

    Returns
    -------
    Played
        Packed data.
    """
    full = contents.tracks
    tracks, kept = thinned(full, shown)
    d = tracks.detections
    points = np.zeros((d.n_points, 3))
    points[:, : d.n_axes] = d.points
    labelled, starts = tracks.by_track
    is_clutter = tracks.labels < 0
    grid = grid_over(points[labelled] if len(labelled) else points, _MARGIN)
    cells, is_on = grid.cells(points)
    drawn_clutter = np.flatnonzero(is_clutter & is_on)
    rows = np.concatenate([labelled, drawn_clutter])
    runs = runs_of(tracks)
    frame_clutter = np.bincount(d.frame_of[drawn_clutter], minlength=d.n_frames)
    arrays: dict[str, NDArray[Any]] = {
        "times": d.times,
        "frames": (shown + _first_frame(full)).astype(np.uint32),
        "trouble": order.astype(np.uint32),
        "starts": starts.astype(np.uint32),
        "runTrack": runs.track.astype(np.uint32),
        "runFirst": runs.first.astype(np.uint32),
        "runLength": runs.length.astype(np.uint32),
        "clutter": frame_clutter.astype(np.uint32),
        "pairs": contents.connections.pairs.astype(np.uint32),
        "segments": contents.connections.segments.astype(np.int32),
    }
    begins = np.unique(np.append(starts[:-1], len(labelled)))
    begins = begins[begins < len(rows)]
    level, coded = _coded(cells[rows], begins)
    arrays |= dict(zip("xyz", coded, strict=True))
    sure = tracks.confidence if tracks.identity_confidence is None else tracks.identity_confidence
    if sure is not None:
        arrays["confidence"] = np.rint(255 * sure[rows]).astype(np.uint8)
    if d.filled is not None and d.filled.any():
        arrays["filled"] = d.filled[rows].astype(np.uint8)
    if (judged := contents.judgement) is not None:
        arrays["verdict"] = judged.verdicts[kept][rows].astype(np.uint8)
        arrays["marker"] = judged.markers[kept][rows].astype(np.int32)
    if contents.editing is not None:
        arrays |= numbers_of(d, rows)
    cameras, tables, lens_error = _cameras(contents)
    arrays |= tables
    subject = subject_of(tracks)
    arrays["course"] = subject.course.astype(np.float32).ravel()
    header: dict[str, Any] = {
        "axes": d.n_axes,
        "order": level,
        "grid": [grid.low.tolist(), grid.step.tolist()],
        "box": _box(points[labelled] if len(labelled) else points),
        "subject": np.round(subject.points, 4).tolist(),
        "up": contents.up,
        "radius": min(_RADIUS, 0.25 * usual_distance(tracks)),
        "names": tracks.display_names,
        "confidence": "Link confidence"
        if tracks.identity_confidence is None
        else "Identity confidence",
        "markers": [] if judged is None else list(judged.names),
        "against": "" if judged is None else judged.against,
        "opens": _opening_frame(d),
        "cameras": cameras,
        "lensSide": SIDE,
        "editor": None if contents.editing is None else asdict(contents.editing),
        "colours": {"cycle": CYCLE, "clutter": CLUTTER, "wrong": WRONG, "missed": MISSED},
    }
    n_outside = int(is_clutter.sum()) - len(drawn_clutter)
    return Played(packed(header, arrays), float(grid.step.max()), n_outside, lens_error)


def _coded(
    cells: NDArray[np.int64], begins: NDArray[np.int64]
) -> tuple[int, list[NDArray[np.uint16]]]:
    """Encode by prediction from one or two earlier values, whichever gives the shorter code."""
    both = {n: [residuals(axis, begins, n) for axis in cells.T] for n in (1, 2)}
    size = {n: sum(float(np.log2(1.0 + r).sum()) for r in rest) for n, rest in both.items()}
    level = min(both, key=lambda n: size[n])
    return level, both[level]


def _box(points: NDArray[np.float64]) -> list[list[float]]:
    """Return the box of nearly all points for the first view, without outliers."""
    if not len(points):
        return [[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]]
    low, high = np.quantile(points, [0.01, 0.99], axis=0)
    return [low.tolist(), high.tolist()]


def _first_frame(tracks: Tracks) -> int:
    d = tracks.detections
    return d.first_frame if isinstance(d, Capture) else 0


def _opening_frame(d: Detections) -> int:
    """Return the first frame with at least half of the median number of points.

    The median is over the frames with points, because many captures begin before the subject
    enters.
    """
    counts = d.counts
    if not counts.any():
        return 0
    return int(np.argmax(2 * counts >= np.median(counts[counts > 0])))


def _cameras(
    contents: Contents,
) -> tuple[list[dict[str, Any]], dict[str, NDArray[Any]], float]:
    headers: list[dict[str, Any]] = []
    tables: dict[str, NDArray[Any]] = {}
    worst = 0.0
    for i, camera in enumerate(contents.rig.cameras if contents.rig is not None else ()):
        table, bounds, error = lens_table(camera)
        headers.append(camera_header(camera, i) | {"bounds": bounds})
        if bounds:
            tables[f"lens{i}"] = table
        worst = max(worst, error)
    return headers, tables, worst
