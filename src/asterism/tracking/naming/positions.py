"""Dense positions of tracks or markers in some frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["positions_in", "scattered"]


def positions_in(
    d: Detections, frames: NDArray[np.int64], columns: NDArray[np.int64], n_columns: int
) -> NDArray[np.float64]:
    """Return the positions in some frames, (frames, columns, 3), NaN without a detection.

    Parameters
    ----------
    d : Detections
        The N detections.
    frames : ndarray of int
        Frames, each once.
    columns : ndarray of int, shape (N,)
        Column of each detection, -1 for none.
    n_columns : int
        Number of columns.
    """
    row = np.full(d.n_frames, -1)
    row[frames] = np.arange(len(frames))
    used = np.flatnonzero((columns >= 0) & (row[d.frame_of] >= 0))
    return scattered(d.points[used], row[d.frame_of[used]], columns[used], len(frames), n_columns)


def scattered(
    points: NDArray[np.float64],
    frames: NDArray[np.int64],
    columns: NDArray[np.int64],
    n_frames: int,
    n_columns: int,
) -> NDArray[np.float64]:
    """Return points as positions of shape (frames, columns, 3), NaN elsewhere; 2-D has z = 0."""
    dense = np.full((n_frames, n_columns, 3), np.nan)
    dense[frames, columns, : points.shape[1]] = points
    if points.shape[1] == 2:
        dense[frames, columns, 2] = 0
    return dense
