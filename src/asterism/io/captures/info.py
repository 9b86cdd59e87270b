"""Figures of a capture: contents, gaps, motion and tracking difficulty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.model import Capture
from asterism.records import record

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["CaptureInfo", "describe"]

_MAX_FRAMES = 10_000  # frames in which neighbours are searched, evenly spaced


@record
class CaptureInfo:
    """Figures of a capture; lengths in millimetres, NaN if there is nothing to measure.

    Parameters
    ----------
    path, format, units, first_frame : Path, str, str, int
        As in `Capture`.
    rate : float
        Frame rate in Hz, from the file or else from the spacing of the times.
    n_frames : int
        Number of frames.
    duration : float
        Number of frames divided by the rate, seconds.
    n_named : int
        Number of named markers.
    n_unlabelled : int
        Number of unnamed channels with detections.
    n_pieces : int
        Number of tracklets in them, from gap to gap.
    n_modelled : int
        Number of computed channels that were left out.
    n_points, n_unidentified : int
        Number of points, and of those without a named marker or tracklet.
    points_min, points_mean, points_max : float
        Number of points per frame.
    absent_percent : float
        Share of missing samples of named markers, 0 to 100.
    n_gaps : int
        Number of gaps of named markers.
    gap_median, gap_longest : float
        Median and largest length of the gaps, frames.
    step_median, step_99 : float
        Displacement of a marker or tracklet per frame, 50th and 99th percentile.
    nearest_step_median, nearest_step_99 : float
        Distance of a point to the nearest point of the next frame, percentiles.
    spacing_1, spacing_5, spacing_50 : float
        Distance of a point to its nearest neighbour in its frame, percentiles.
    confusion_percent : float
        Points whose nearest point in the next frame is another identity, among those whose own
        is there.
    difficulty : str
        "easy", "moderate", "hard", or "unknown" without identities or neighbours.
    reason : str
        Measurements that decided the difficulty, in words.
    warnings, truncated : tuple of str, str
        As in `Capture`.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.write(am.simulate.cube(frames=20, seed=1), f"{folder}/cube.csv")
    ...     found = am.io.describe(am.read(f"{folder}/cube.csv"))
    >>> found.points_min, found.points_max, found.n_gaps
    (8, 8, 0)
    """

    path: Path
    format: str
    units: str
    first_frame: int
    rate: float
    n_frames: int
    duration: float
    n_named: int
    n_unlabelled: int
    n_pieces: int
    n_modelled: int
    n_points: int
    n_unidentified: int
    points_min: int
    points_mean: float
    points_max: int
    absent_percent: float
    n_gaps: int
    gap_median: float
    gap_longest: int
    step_median: float
    step_99: float
    nearest_step_median: float
    nearest_step_99: float
    spacing_1: float
    spacing_5: float
    spacing_50: float
    confusion_percent: float
    difficulty: str
    reason: str
    warnings: tuple[str, ...]
    truncated: str


def describe(capture: Capture) -> CaptureInfo:
    """Measure the contents of a capture and how difficult it is to track.

    Parameters
    ----------
    capture : Capture
        Capture to measure.

    Returns
    -------
    CaptureInfo
        Figures of the capture.

    Notes
    -----
    Without named markers, displacements are those of the tracklets of the recording system. They
    end at difficult places, so that the difficulty is underestimated. In captures of more than
    10 000 frames, neighbours are searched in evenly spaced frames.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.write(am.simulate.cube(frames=20, seed=1), f"{folder}/cube.csv")
    ...     found = am.io.describe(am.read(f"{folder}/cube.csv"))
    >>> found.n_named, found.n_frames, found.difficulty
    (8, 20, 'easy')
    """
    check_kind("capture", capture, Capture, "am.read(path)")
    named = np.array([name is not None for name in capture.names], dtype=bool)
    is_named = np.zeros(capture.n_points, dtype=bool)
    has_label = capture.labels >= 0
    is_named[has_label] = named[capture.labels[has_label]]
    gaps, n_present, n_missing = _gaps(capture, is_named)
    steps = _steps(capture)
    nearest, spacing, n_confused, n_followed = _neighbours(capture)
    confusion = 100 * n_confused / n_followed if n_followed else np.nan
    rate = capture.rate or (1 / capture.step if capture.step else 0.0)
    counts = capture.counts
    absent = 100 * n_missing / n_present if n_present else np.nan
    if n_followed and len(spacing):
        another = "marker" if named.any() else "piece of a trajectory"
        difficulty, reason = _verdict(confusion, absent, steps, spacing, another)
    else:
        difficulty, reason = "unknown", _without_identities(nearest, spacing)
    others = capture.channels[~is_named & (capture.channels >= 0)]
    return CaptureInfo(
        path=capture.path,
        format=capture.format,
        units=capture.units,
        first_frame=capture.first_frame,
        rate=rate,
        n_frames=capture.n_frames,
        duration=float(np.ptp(capture.times)) + capture.step if capture.n_frames else 0.0,
        n_named=int(named.sum()),
        n_unlabelled=len(np.unique(others)),
        n_pieces=int((~named).sum()),
        n_modelled=len(capture.modelled),
        n_points=capture.n_points,
        n_unidentified=int((~has_label).sum()),
        points_min=int(counts.min()) if len(counts) else 0,
        points_mean=float(counts.mean()) if len(counts) else 0.0,
        points_max=int(counts.max(initial=0)),
        absent_percent=float(absent),
        n_gaps=len(gaps),
        gap_median=float(np.median(gaps)) if len(gaps) else 0.0,
        gap_longest=int(gaps.max(initial=0)),
        step_median=_percentile(steps, 50),
        step_99=_percentile(steps, 99),
        nearest_step_median=_percentile(nearest, 50),
        nearest_step_99=_percentile(nearest, 99),
        spacing_1=_percentile(spacing, 1),
        spacing_5=_percentile(spacing, 5),
        spacing_50=_percentile(spacing, 50),
        confusion_percent=float(confusion),
        difficulty=difficulty,
        reason=reason,
        warnings=capture.warnings,
        truncated=capture.truncated,
    )


def _percentile(metres: NDArray[np.float64], q: float) -> float:
    return float(np.percentile(metres, q)) * 1000 if len(metres) else float("nan")


def _gaps(capture: Capture, is_named: NDArray[np.bool_]) -> tuple[NDArray[np.int64], int, int]:
    """Return the lengths of the gaps of named markers, their possible and their missing samples."""
    label, frame = capture.labels[is_named], capture.frame_of[is_named]
    order = np.argsort(label, kind="stable")
    label, frame = label[order], frame[order]
    hole = np.diff(frame) - 1
    gaps = hole[(np.diff(label) == 0) & (hole > 0)]
    n_possible = len(np.unique(label)) * capture.n_frames
    return gaps, n_possible, n_possible - len(label)


def _next_of_same(capture: Capture) -> NDArray[np.int64]:
    """Index of the same identity's detection in the next frame, shape (N,), -1 where none."""
    order = np.argsort(capture.labels, kind="stable")
    label, frame = capture.labels[order], capture.frame_of[order]
    follows = (np.diff(label) == 0) & (np.diff(frame) == 1) & (label[1:] >= 0)
    following = np.full(capture.n_points, -1)
    following[order[:-1][follows]] = order[1:][follows]
    return following


def _steps(capture: Capture) -> NDArray[np.float64]:
    """Displacements of identities from one frame to the next, metres."""
    following = _next_of_same(capture)
    moved = following >= 0
    return np.linalg.norm(capture.points[following[moved]] - capture.points[moved], axis=1)


def _neighbours(
    capture: Capture,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, int]:
    """Distances to the nearest point of the next frame and of the own one, metres.

    Also how many identities have another one nearest in the next frame, and of how many.
    """
    from scipy import spatial

    following = _next_of_same(capture)
    points, offsets = capture.points, capture.offsets
    steps: list[NDArray[np.float64]] = []
    spacing: list[NDArray[np.float64]] = []
    n_confused = n_followed = 0
    stride = max(-(-capture.n_frames // _MAX_FRAMES), 1)
    for t in range(0, capture.n_frames, stride):
        here = slice(int(offsets[t]), int(offsets[t + 1]))
        n = here.stop - here.start
        if n == 0:
            continue
        tree = spatial.KDTree(points[here])
        if n > 1:
            spacing.append(tree.query(points[here], k=2)[0][:, 1])
        before = slice(int(offsets[max(t - 1, 0)]), here.start)
        if before.start < before.stop:
            distance, nearest = tree.query(points[before])
            steps.append(distance)
            is_followed = following[before] >= 0
            n_confused += int((here.start + nearest != following[before])[is_followed].sum())
            n_followed += int(is_followed.sum())
    empty = np.empty(0)
    return (
        np.concatenate([*steps, empty]),
        np.concatenate([*spacing, empty]),
        n_confused,
        n_followed,
    )


def _verdict(
    confusion: float,
    absent: float,
    steps: NDArray[np.float64],
    spacing: NDArray[np.float64],
    another: str,
) -> tuple[str, str]:
    reason = (
        f"for {confusion:.2g} % of the points the nearest in the next frame is another {another}"
    )
    pace, text = _pace(steps, spacing)
    reason += f"; fast ones move {text}"
    if absent > 10:
        reason += f"; {absent:.2g} % of the samples are absent"
    if confusion > 5:
        return "hard", reason
    return ("moderate" if confusion > 0.5 or pace > 1 or absent > 10 else "easy"), reason


def _pace(steps: NDArray[np.float64], spacing: NDArray[np.float64]) -> tuple[float, str]:
    """Return the ratio of fast displacements to small distances, and a text of it."""
    fast, close = _percentile(steps, 99), _percentile(spacing, 5)
    if close > 0:
        return fast / close, f"{fast / close:.2g} times the distance of close ones"
    return np.inf, f"{fast:.3g} mm, and 5 % of the points or more lie exactly on another"


def _without_identities(nearest: NDArray[np.float64], spacing: NDArray[np.float64]) -> str:
    if not len(spacing):
        return "no frame holds two points that could be taken for each other"
    reason = "the file has no identities to compare"
    if not len(nearest):
        return reason
    text = _pace(nearest, spacing)[1]
    return f"{reason}; to the nearest point of the next frame fast ones move {text}"
