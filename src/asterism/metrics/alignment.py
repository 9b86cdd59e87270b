"""Finding the same detections in two captures, so that labels can be compared by identity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.metrics.matching import same_detections, same_frames
from asterism.model import Tracks
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Alignment", "align", "marker_labels"]


@record(eq=False)
class Alignment:
    """Tracks and truth as two labels for each detection that either of them has.

    Attributes
    ----------
    times : ndarray, shape (T,)
        Times of all frames, seconds.
    frame_of : ndarray of int, shape (N,)
        Frame of each detection, never decreasing.
    i_tracks, i_truth : ndarray of int, shape (N,)
        Its index among the detections of either side, -1 where that side lacks it.
    labels, truth_labels : ndarray of int, shape (N,)
        Its track and its marker, -1 for none.
    """

    times: NDArray[np.float64]
    frame_of: NDArray[np.int64]
    i_tracks: NDArray[np.int64]
    i_truth: NDArray[np.int64]
    labels: NDArray[np.int64]
    truth_labels: NDArray[np.int64]

    def __repr__(self) -> str:
        n_both = int(((self.i_tracks >= 0) & (self.i_truth >= 0)).sum())
        return (
            f"Alignment({len(self.times)} frames, {len(self.labels)} detections, "
            f"{n_both} of them on both sides)"
        )


def align(tracks: Tracks, truth: Tracks, *, tolerance: float = 1e-6) -> Alignment:
    """Lay tracks and truth beside each other, detection by detection.

    Frames are the same if their times differ by less than half the smallest spacing of either
    side. In the same frame, detections are the same if each is the other's nearest and every
    coordinate agrees to `tolerance`, over and above the rounding to 32-bit millimetres that files
    do. Of several at one place the first belongs to the first, and so on. A detection that only
    the truth has is unlabelled; one that only the tracks have is clutter.

    In the truth, tracks without a name are clutter as soon as one track has a name; where none
    has, all are markers.

    Parameters
    ----------
    tracks, truth : Tracks
        What was found and what is so.
    tolerance : float
        Greatest difference of a coordinate, metres.

    Returns
    -------
    Alignment

    Raises
    ------
    ParameterError
        If fewer than half of the detections of either side are found on the other.
    """
    check_number("tolerance", tolerance, above=0, closed=True)
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("truth", truth, Tracks, "am.io.read_tracks(path)")
    a, b = tracks.detections, truth.detections
    i_a, i_b = same_detections(a, b, tolerance)
    for n in (a.n_points, b.n_points):
        if 2 * len(i_a) < n:
            raise ParameterError(
                "tracks",
                "the detections of the truth",
                f"{len(i_a)} in common of {a.n_points} and {b.n_points}",
                "are both of the same capture, in the same units and with the same times?",
            )
    only_a, only_b = np.ones(a.n_points, dtype=bool), np.ones(b.n_points, dtype=bool)
    only_a[i_a], only_b[i_b] = False, False
    only_a, only_b = np.flatnonzero(only_a), np.flatnonzero(only_b)
    i_tracks = np.concatenate([i_a, only_a, np.full(len(only_b), -1)])
    i_truth = np.concatenate([i_b, np.full(len(only_a), -1), only_b])

    frame_a, frame_b = same_frames(a, b)
    is_new = np.ones(b.n_frames, dtype=bool)
    is_new[frame_b] = False
    times = np.concatenate([a.times, b.times[is_new]])
    rank = np.empty(len(times), dtype=np.int64)
    rank[np.argsort(times)] = np.arange(len(times))
    rank_of_b = np.empty(b.n_frames, dtype=np.int64)
    rank_of_b[frame_b], rank_of_b[is_new] = rank[frame_a], rank[a.n_frames :]
    in_a = np.concatenate([i_a, only_a])
    frames = np.concatenate([rank[a.frame_of[in_a]], rank_of_b[b.frame_of[only_b]]])

    order = np.argsort(frames, kind="stable")
    i_tracks, i_truth = i_tracks[order], i_truth[order]
    # One more label at the end, so that the index -1 (not there) means -1 (none).
    return Alignment(
        times=np.sort(times),
        frame_of=frames[order],
        i_tracks=i_tracks,
        i_truth=i_truth,
        labels=np.append(tracks.labels, -1)[i_tracks],
        truth_labels=np.append(marker_labels(truth), -1)[i_truth],
    )


def marker_labels(truth: Tracks) -> NDArray[np.int64]:
    """Give the labels of the truth with unnamed tracks as clutter, if any track has a name."""
    has_name = np.array([name is not None for name in truth.names], dtype=bool)
    if has_name.all() or not has_name.any():
        return truth.labels
    return np.append(np.where(has_name, np.arange(len(has_name)), -1), -1)[truth.labels]
