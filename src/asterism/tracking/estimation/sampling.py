"""Runs of frames that represent a capture, because an estimate does not need every frame."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, Tracks
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Runs", "sample_runs"]

N_RUNS = 8
"""Largest number of runs."""
MIN_FRAMES = 20
"""Smallest number of frames in a run."""


@record(eq=False)
class Runs:
    """Runs of frames, tracked each by itself and counted together.

    Parameters
    ----------
    pieces : list of Detections
        Runs in the order of their times.
    """

    pieces: list[Detections]

    @cached_property
    def joined(self) -> Detections:
        """All runs as one capture, one after the other."""
        if len(self.pieces) == 1:
            return self.pieces[0]
        ends = np.cumsum([0, *(piece.n_points for piece in self.pieces)])
        offsets = [piece.offsets[:-1] + end for piece, end in zip(self.pieces, ends, strict=False)]
        own = [p.covariances for p in self.pieces if p.covariances is not None]
        return Detections(
            times=np.concatenate([piece.times for piece in self.pieces]),
            offsets=np.concatenate([*offsets, ends[-1:]]),
            points=np.concatenate([piece.points for piece in self.pieces]),
            covariances=np.concatenate(own) if own else None,
        )

    def tracks(self, labels: Sequence[NDArray[np.int64]]) -> Tracks:
        """Return the tracks of all runs. No track extends over two runs.

        Parameters
        ----------
        labels : sequence of ndarray of int
            Labels of each run.

        Returns
        -------
        Tracks
        """
        if len(labels) == 1:
            return Tracks(detections=self.joined, labels=labels[0])
        counts = [int(own.max(initial=-1)) + 1 for own in labels]
        shifts = np.cumsum([0, *counts])
        shifted = [np.where(own < 0, -1, own + n) for own, n in zip(labels, shifts, strict=False)]
        return Tracks(detections=self.joined, labels=np.concatenate(shifted))


def sample_runs(
    detections: Detections, activity: NDArray[np.float64], n_points: int
) -> list[Detections]:
    """Cut out runs of consecutive frames, from the most active one to a quiet one.

    The capture is divided into runs of equal length, which are ranked by their mean activity.
    Runs at regular ranks are returned. The most active run is always one of them, because a short
    fast motion between slow ones would be lost by a model that does not know it.

    Parameters
    ----------
    detections : Detections
        Capture.
    activity : ndarray of shape (T,)
        Activity of each frame, as of `first_scales`; NaN where it was not measured.
    n_points : int
        Number of detections in all runs, about.

    Returns
    -------
    list of Detections
        Runs in the order of their times; the whole capture if it is short enough.
    """
    T = detections.n_frames
    n_frames = max(T * n_points // detections.n_points, MIN_FRAMES)
    if n_frames >= T:
        return [detections]
    n_runs = min(N_RUNS, n_frames // MIN_FRAMES)
    length = n_frames // n_runs
    starts = np.arange(0, T - length + 1, length)
    by_run = activity[: len(starts) * length].reshape(len(starts), length)
    is_known = np.isfinite(by_run)
    known = np.flatnonzero(is_known.any(axis=1))
    mean = np.where(is_known, by_run, 0)[known].sum(axis=1) / is_known[known].sum(axis=1)
    ranked = known[np.argsort(-mean, kind="stable")]
    chosen = ranked[np.arange(min(n_runs, len(ranked))) * len(ranked) // n_runs]
    return [detections.part(int(s), int(s) + length) for s in np.sort(starts[chosen])]
