"""Labels: the track of each detection, and what makes an array of them a partition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["MAX_TRACKS", "check_labels"]

MAX_TRACKS = 10_000_000
"""Largest number of tracks that is accepted; larger labels are refused as mistakes."""
CHECKED_POINTS = 500_000
"""Number of detections that are checked at once."""


def check_labels(labels: NDArray[np.int64], offsets: NDArray[np.int64]) -> int:
    """Check that labels are track numbers, each at most once in a frame; return how many tracks.

    Parameters
    ----------
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    offsets : ndarray of int, shape (T + 1,)
        First detection of each frame.

    Returns
    -------
    int
        Largest label + 1.

    Raises
    ------
    ParameterError
        If a label is out of range, or a track has two detections in one frame.
    """
    if labels.size and not -1 <= labels.min() <= labels.max() < MAX_TRACKS:
        wrong = labels.min() if labels.min() < -1 else labels.max()
        raise ParameterError(
            "labels", f"track numbers from 0 to {MAX_TRACKS - 1}, or -1 for clutter", wrong
        )
    n_tracks = int(labels.max()) + 1 if labels.size else 0
    twice = _first_twice(offsets, labels, n_tracks)
    if twice is not None:
        raise ParameterError(
            "labels", "at most one detection of a track in a frame",
            f"two of track {twice[1]} in frame {twice[0]}",
        )  # fmt: skip
    return n_tracks


def _first_twice(
    offsets: NDArray[np.int64], labels: NDArray[np.int64], n_tracks: int
) -> tuple[int, int] | None:
    """Return a frame and a track with two detections in it, or None if there are none.

    Parameters
    ----------
    offsets : ndarray of int, shape (T + 1,)
        First detection of each frame.
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    n_tracks : int
        Number of tracks.
    """
    t, T = 0, len(offsets) - 1
    while t < T:  # in parts, which take little memory
        end = int(np.searchsorted(offsets, offsets[t] + CHECKED_POINTS))
        end = min(max(end, t + 1), T)
        counts = np.diff(offsets[t : end + 1])
        own = labels[offsets[t] : offsets[end]]
        twice = _twice_in(np.repeat(np.arange(end - t), counts), own, n_tracks)
        if twice is not None:
            return t + twice[0], twice[1]
        t = end
    return None


def _twice_in(
    frames: NDArray[np.int64], labels: NDArray[np.int64], n_tracks: int
) -> tuple[int, int] | None:
    """Do the same for the frame of each detection."""
    if labels.size and labels.min() < 0:
        frames, labels = frames[labels >= 0], labels[labels >= 0]
    if not labels.size:
        return None
    key = frames * n_tracks
    key += labels
    n_cells = (int(frames[-1]) + 1) * n_tracks
    if n_cells <= 16 * len(key):  # marking frame and track is much faster than sorting
        is_taken = np.zeros(n_cells, dtype=bool)
        is_taken[key] = True
        if np.count_nonzero(is_taken) == len(key):
            return None
    key.sort()
    twice = np.flatnonzero(key[1:] == key[:-1])
    if not len(twice):
        return None
    frame, track = divmod(int(key[int(twice[0])]), n_tracks)
    return frame, track
