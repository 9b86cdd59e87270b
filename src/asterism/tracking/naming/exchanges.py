"""Stretches in which two tracks have exchanged their markers, found without any names.

Distances to steady neighbours show an exchange: those of both tracks change at the same time, each
to what the other's were before.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.tracking.naming.positions import positions_in, scattered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, Tracks

__all__ = ["without_exchanges"]

LENGTH = 600
"""Number of frames in which tracks are compared at a time, overlapping by half."""
SAMPLED = 60
"""Number of these frames in which distances are measured."""
MIN_FRAMES = 5
"""Smallest number of sampled frames of a stretch, of the rest, and of a distance in each."""


def without_exchanges(tracks: Tracks) -> Tracks:
    """Exchange two tracks back from where they have each other's marker.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture. Exchanges that last less than `MIN_FRAMES` of the `SAMPLED` frames
        are not found.

    Returns
    -------
    Tracks
        Tracks of the same detections.
    """
    n = tracks.detections.n_frames
    labels = tracks.labels.copy()
    for start in range(0, max(n - LENGTH // 2, 1), LENGTH // 2):
        _exchange_back(tracks.detections, labels, start, min(start + LENGTH, n))
    return tracks if np.array_equal(labels, tracks.labels) else replace(tracks, labels=labels)


def _exchange_back(d: Detections, labels: NDArray[np.int64], start: int, end: int) -> None:
    """Exchange labels in place, as the frames from `start` to `end` show."""
    chosen = np.unique(np.linspace(start, end - 1, SAMPLED).astype(np.int64))
    is_chosen = np.zeros(d.n_frames, dtype=bool)
    is_chosen[chosen] = True
    own = labels[(labels >= 0) & is_chosen[d.frame_of]]
    alive = np.flatnonzero(np.bincount(own) >= 2 * MIN_FRAMES)
    column = np.full(labels.max(initial=-1) + 2, -1)  # the last element is for clutter
    column[alive] = np.arange(len(alive))
    at = positions_in(d, chosen, column[labels], len(alive))
    for a, b, first, last in _engine.exchanges_by_distances(at, min_frames=MIN_FRAMES):
        pair = alive[[a, b]]
        for edge in sorted({first, last} - {0, len(chosen)}):  # each exchanges all frames after it
            around = chosen[[max(edge - 2, 0), min(edge + 1, len(chosen) - 1)]]
            rows = slice(d.offsets[_moment(d, labels, pair, *around)], None)
            own = labels[rows]
            is_one, is_other = own == pair[0], own == pair[1]
            own[is_one], own[is_other] = pair[1], pair[0]


def _moment(
    d: Detections, labels: NDArray[np.int64], pair: NDArray[np.int64], first: int, last: int
) -> int:
    """Return the frame in (first, last] from which an exchange of two tracks shortens their way."""
    rows = np.arange(*d.offsets[[first, last + 1]])
    rows = rows[np.isin(labels[rows], pair)]
    column = np.searchsorted(np.sort(pair), labels[rows])
    at = scattered(d.points[rows], d.frame_of[rows] - first, column, last - first + 1, 2)
    for t in range(1, len(at)):  # an occluded marker stays where it was
        at[t] = np.where(np.isnan(at[t]), at[t - 1], at[t])
    kept = np.linalg.norm(at[1:] - at[:-1], axis=2).sum(axis=1)
    exchanged = np.linalg.norm(at[1:] - at[:-1, ::-1], axis=2).sum(axis=1)
    return first + 1 + int(np.argmax(np.nan_to_num(kept - exchanged, nan=-np.inf)))
