"""Alignment of tracks and truth, so that labels are compared detection by detection."""

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
    """Tracks and truth as two labels for each detection of either side.

    Attributes
    ----------
    times : ndarray of shape (T,)
        Times of all frames, seconds.
    frame_of : ndarray of int, shape (N,)
        Frame of each detection, in increasing order.
    i_tracks, i_truth : ndarray of int, shape (N,)
        Index of each detection among the detections of that side, -1 if that side lacks it.
    labels, truth_labels : ndarray of int, shape (N,)
        Track and marker of each detection, -1 for none.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> align(truth, truth).labels.tolist() == truth.labels.tolist()
    True
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
    """Match the detections of tracks and truth, and pair their labels.

    Frames match if their times differ by less than half the smallest spacing of either side. In
    matching frames, detections match if each is the nearest to the other and every coordinate
    agrees to `tolerance`, in addition to the rounding of files to 32-bit millimetres. Several
    detections at one place are matched in their order. A detection of the truth alone is
    unlabelled; a detection of the tracks alone is clutter.

    If any track of the truth has a name, the unnamed tracks are clutter; otherwise all tracks are
    markers.

    Parameters
    ----------
    tracks, truth : Tracks
        Tracks to score, and the ground truth.
    tolerance : float
        Largest difference of a coordinate, metres.

    Returns
    -------
    Alignment

    Raises
    ------
    ParameterError
        If fewer than half of the detections of either side match.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> align(truth, truth).labels.shape
    (160,)
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
    # A further label at the end makes the index -1 (absent) yield the label -1 (none).
    return Alignment(
        times=np.sort(times),
        frame_of=frames[order],
        i_tracks=i_tracks,
        i_truth=i_truth,
        labels=np.append(tracks.labels, -1)[i_tracks],
        truth_labels=np.append(marker_labels(truth), -1)[i_truth],
    )


def marker_labels(truth: Tracks) -> NDArray[np.int64]:
    """Return the truth's labels, with unnamed tracks as clutter if any track has a name.

    Examples
    --------
    >>> truth = Tracks.from_dense([0], [[[0, 0, 0], [1, 0, 0]]], ["LKNE", None])
    >>> marker_labels(truth)
    array([ 0, -1])
    """
    has_name = np.array([name is not None for name in truth.names], dtype=bool)
    if has_name.all() or not has_name.any():
        return truth.labels
    return np.append(np.where(has_name, np.arange(len(has_name)), -1), -1)[truth.labels]
