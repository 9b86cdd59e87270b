"""The subject of a capture: its course through space, and its size, for the view of the player."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Subject", "subject_of"]

MAX_KNOTS = 2000
"""Largest number of points of the course."""
SMOOTH = 1.0
"""Length of the moving average of the course, seconds."""
LONG = 0.25
"""Shortest track of the subject, relative to the longest."""
ROOM = 0.4
"""Distance from the middle nine tenths of the points, relative to their extent, of a stray."""
MAX_OUTERMOST = 200
"""Number of points that stand for the size of the subject."""


class Subject(NamedTuple):
    """Course and size of what moves in a capture.

    Attributes
    ----------
    course : ndarray of shape (M, 3)
        Smoothed mean of the points at evenly spaced frames, the first and the last included.
    points : ndarray of shape (N, 3)
        Points of all frames relative to the course, without strays.
    """

    course: NDArray[np.float64]
    points: NDArray[np.float64]


def subject_of(tracks: Tracks) -> Subject:
    """Find the course and the size of what moves in a capture.

    Parameters
    ----------
    tracks : Tracks
        Tracks in 2-D or 3-D. Without a labelled point, all points are used.
    """
    d = tracks.detections
    long = tracks.lengths >= LONG * tracks.lengths.max(initial=0)
    used = np.flatnonzero((tracks.labels >= 0) & np.append(long, False)[tracks.labels])
    if not len(used):
        used = np.arange(d.n_points)
    if not len(used):
        return Subject(np.zeros((1, 3)), np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]]))
    points = np.zeros((len(used), 3))
    points[:, : d.n_axes] = d.points[used]
    frame = d.frame_of[used]
    n = np.bincount(frame, minlength=d.n_frames)
    seen = np.flatnonzero(n)
    every = np.arange(d.n_frames)
    half = round(0.5 * SMOOTH / d.step) if d.step else 0
    course = np.empty((d.n_frames, 3))
    for axis, x in enumerate(points.T):
        mean = np.bincount(frame, x, d.n_frames)[seen] / n[seen]
        sums = np.concatenate([[0.0], np.cumsum(np.interp(every, seen, mean))])
        low, high = np.maximum(every - half, 0), np.minimum(every + half + 1, d.n_frames)
        course[:, axis] = (sums[high] - sums[low]) / (high - low)
    few = np.linspace(0, len(used) - 1, min(len(used), 100 * MAX_OUTERMOST)).astype(int)
    around = points[few] - course[frame[few]]
    low, high = np.quantile(around, [0.05, 0.95], axis=0)
    room = ROOM * max(float((high - low).max()), 0.01)
    around = around[((around >= low - room) & (around <= high + room)).all(axis=1)]
    knots = np.linspace(0, d.n_frames - 1, min(d.n_frames, MAX_KNOTS)).astype(int)
    return Subject(course[knots], _outermost(around))


def _outermost(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the farthest points in evenly spread directions."""
    k = np.arange(MAX_OUTERMOST) + 0.5
    z = 1 - 2 * k / MAX_OUTERMOST
    turn, r = np.pi * (1 + 5**0.5) * k, np.sqrt(1 - z**2)
    ways = np.stack([r * np.cos(turn), r * np.sin(turn), z])
    return points[np.unique(np.argmax(points @ ways, axis=0))]
