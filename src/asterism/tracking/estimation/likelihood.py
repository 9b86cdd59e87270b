"""Likelihood of motion and noise given tracks, the objective of the motion fit.

It equals the sum of `asterism.filter.filter_states(...).log_densities`. The engine holds the data
and evaluates several fits in a call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model import DWNA, RandomWalk, Tracks
from asterism.model.compiled import steps_of, with_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.tracking.estimation.fitted_motion import MotionFit

__all__ = ["TrackLikelihood"]

PIECE_POINTS = 60
UNITS = {"dwna": DWNA(acceleration_sigma=1.0), "random_walk": RandomWalk(walk_sigma=1.0)}


class TrackLikelihood:
    """Log density of the detections of tracks, each given the earlier ones of its track.

    Parameters
    ----------
    tracks : Tracks
        Tracks of runs of frames.
    velocity_sigma : float
        Prior standard deviation of a velocity coordinate, m/s.
    n_points : int
        Number of detections that are used, about, in pieces of tracks spread over the capture.
    """

    def __init__(self, tracks: Tracks, velocity_sigma: float, n_points: int) -> None:
        self._sample = _sample(tracks, n_points)
        self.n_points = self._sample.detections.n_points
        self.n_links = self.n_points - self._sample.n_tracks
        self._velocity_variance = velocity_sigma**2
        self._engines: dict[str, _engine.MotionLikelihood] = {}

    def _engine_of(self, kind: str) -> _engine.MotionLikelihood:
        """Return the engine of a class of motion."""
        if kind not in self._engines:
            d = self._sample.detections
            order, offsets = self._sample.by_track
            steps_kind, F, Q = steps_of(UNITS[kind], d.times)
            steps = np.zeros((len(F), 4))  # a random walk has no velocity
            if kind == "dwna":
                steps[:] = np.stack([F[:, 0, 0, 1], Q[:, 0, 0, 0], Q[:, 0, 0, 1], Q[:, 0, 1, 1]], 1)
            else:
                steps[:, 1] = Q[:, 0, 0, 0]
            self._engines[kind] = _engine.MotionLikelihood(
                n_axes=d.n_axes, points=with_noise(d.points, d.covariances)[order],
                frames=d.frame_of[order], offsets=offsets, kind=steps_kind, steps=steps,
            )  # fmt: skip
        return self._engines[kind]

    def sums(self, fits: Sequence[MotionFit]) -> NDArray[np.float64]:
        """Return the log likelihood of several motions and noises.

        Parameters
        ----------
        fits : sequence of MotionFit
            Motions of one class, with their noise.

        Returns
        -------
        ndarray of shape (fits,)
            Sum over the sampled detections, nats.
        """
        return self._engine_of(fits[0].kind).sums(
            squares=np.square([fit.levels for fit in fits]),
            transitions=np.array([fit.transitions for fit in fits]),
            variances=np.square([fit.noise for fit in fits]),
            velocity_variance=self._velocity_variance,
        )


def _sample(tracks: Tracks, n_points: int) -> Tracks:
    """Cut the tracks into pieces of `PIECE_POINTS` and return evenly spread ones."""
    d = tracks.detections
    order, offsets = tracks.by_track
    stride = max(1, round(len(order) / n_points))
    rank = np.arange(len(order)) - np.repeat(offsets[:-1], tracks.lengths)
    piece = np.cumsum(rank % PIECE_POINTS == 0) - 1
    labels = np.full(d.n_points, -1, dtype=np.int64)
    labels[order] = np.where(piece % stride == 0, piece // stride, -1)
    is_kept = labels >= 0
    return Tracks(detections=d.keep(is_kept), labels=labels[is_kept])
