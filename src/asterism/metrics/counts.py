"""Functions shared by the scores: checks of label arrays, overlaps and successions.

Both label arrays refer to the same N detections, in the order of their frames. A track (or marker)
has at most one detection in a frame, as `Tracks` guarantees.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from asterism.checks import check_array
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Overlap", "check_frames", "check_labels", "overlap", "ratio", "successions"]


def check_labels(
    labels: ArrayLike, truth_labels: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return both label arrays, shape (N,), or raise `ParameterError`."""
    labels = check_array("labels", labels, ("N",), dtype=np.int64)
    truth_labels = check_array("truth_labels", truth_labels, (len(labels),), dtype=np.int64)
    for name, array in (("labels", labels), ("truth_labels", truth_labels)):
        if array.size and array.min() < -1:
            raise ParameterError(name, "numbers ≥ 0, or -1 for clutter", array.min())
    return labels, truth_labels


def check_frames(
    frame_of: ArrayLike, n: int, n_frames: int | None
) -> tuple[NDArray[np.int64], int]:
    """Return the frames of `n` detections and their number, or raise `ParameterError`."""
    frame_of = check_array("frame_of", frame_of, (n,), dtype=np.int64)
    if n and (frame_of[0] < 0 or (np.diff(frame_of) < 0).any()):
        raise ParameterError("frame_of", "frames ≥ 0 that never decrease", "others")
    minimum = int(frame_of[-1]) + 1 if n else 0
    if n_frames is not None and n_frames < minimum:
        raise ParameterError("n_frames", f"at least {minimum}", n_frames)
    return frame_of, minimum if n_frames is None else n_frames


class Overlap(NamedTuple):
    """Numbers of detections that tracks and markers share.

    Attributes
    ----------
    markers, tracks, counts : ndarray of int, shape (P,)
        Marker, track and number of shared detections of each pair that shares any, ordered by
        marker and then by track.
    marker_sizes, track_sizes : ndarray of int, shape (M,), (K,)
        Number of detections of each marker and of each track.
    """

    markers: NDArray[np.int64]
    tracks: NDArray[np.int64]
    counts: NDArray[np.int64]
    marker_sizes: NDArray[np.int64]
    track_sizes: NDArray[np.int64]


def overlap(labels: NDArray[np.int64], truth_labels: NDArray[np.int64]) -> Overlap:
    """Count the detections shared by each pair of a marker and a track."""
    from scipy.sparse import coo_array

    track_sizes = np.bincount(labels[labels >= 0])
    marker_sizes = np.bincount(truth_labels[truth_labels >= 0])
    both = (labels >= 0) & (truth_labels >= 0)
    ones = np.ones(np.count_nonzero(both), dtype=np.int64)
    shape = (len(marker_sizes), len(track_sizes))
    table = coo_array((ones, (truth_labels[both], labels[both])), shape=shape).tocsr()
    table.sort_indices()  # the conversion to CSR has summed the duplicates
    return Overlap(
        np.repeat(np.arange(len(marker_sizes)), np.diff(table.indptr)),
        table.indices.astype(np.int64),
        table.data.astype(np.int64),
        marker_sizes,
        track_sizes,
    )


def successions(labels: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs of consecutive detections in a track: (predecessors, successors)."""
    members = np.flatnonzero(labels >= 0)
    own = labels[members]
    if own.size and own.max() < 2**16:
        own = own.astype(np.uint16)  # NumPy sorts 16-bit integers by radix, several times faster
    order = np.argsort(own, kind="stable")
    members, own = members[order], own[order]
    is_link = own[1:] == own[:-1]
    return members[:-1][is_link], members[1:][is_link]


def ratio(part: float | np.integer[Any], whole: float | np.integer[Any]) -> float:
    """Return ``part / whole``, NaN if `whole` is 0."""
    return float(part) / float(whole) if whole else math.nan
