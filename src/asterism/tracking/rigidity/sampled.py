"""Evenly spread frames of a capture, and the positions of its tracks in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["MAX_FRAMES", "positions_in", "sampled_frames", "sampled_positions"]

MAX_FRAMES = 500
"""Number of frames in which the distances between all tracks of a capture are measured."""


def sampled_frames(n_frames: int, n_most: int) -> NDArray[np.int64]:
    """Return up to `n_most` evenly spread frames."""
    n = min(n_most, n_frames)
    return np.arange(n) * n_frames // max(n, 1)


def positions_in(
    detections: Detections, labels: NDArray[np.int64], n_tracks: int, frames: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the positions in some frames, (F, K, D), NaN without a detection."""
    d = detections
    number = np.full(d.n_frames, -1)
    number[frames] = np.arange(len(frames))
    used = np.flatnonzero((labels >= 0) & (number[d.frame_of] >= 0))
    found = np.full((len(frames), n_tracks, d.n_axes), np.nan)
    found[number[d.frame_of[used]], labels[used]] = d.points[used]
    return found


def sampled_positions(
    detections: Detections, labels: NDArray[np.int64], n_tracks: int
) -> NDArray[np.float64]:
    """Return the positions in up to `MAX_FRAMES` frames, (F, K, D), NaN without a detection."""
    frames = sampled_frames(detections.n_frames, MAX_FRAMES)
    return positions_in(detections, labels, n_tracks, frames)
