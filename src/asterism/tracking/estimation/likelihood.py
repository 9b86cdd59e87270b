"""Likelihood of motion and noise given tracks, the objective of the motion fit.

It equals the sum of `asterism.filter.filter_states(...).log_densities`. The engine holds the data
and evaluates several fits in a call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model import DWNA, RandomWalk
from asterism.model.compiled import steps_of, with_noise
from asterism.tracking.estimation.fitted_motion import transition_matrices

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from asterism.model import Tracks
    from asterism.tracking.estimation.fitted_motion import Kind

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
        self._tracks = tracks
        self._order, self._offsets = _sample(tracks, n_points)
        self.n_points = len(self._order)
        self.n_links = self.n_points - (len(self._offsets) - 1)
        self._velocity_variance = velocity_sigma**2
        self._engines: dict[str, _engine.MotionLikelihood] = {}

    def _engine_of(self, kind: str) -> _engine.MotionLikelihood:
        """Return the engine of a class of motion."""
        if kind not in self._engines:
            d = self._tracks.detections
            steps_kind, F, Q = steps_of(UNITS[kind], d.times)
            steps = np.zeros((len(F), 4))  # a random walk has no velocity
            if kind == "dwna":
                steps[:] = np.stack([F[:, 0, 0, 1], Q[:, 0, 0, 0], Q[:, 0, 0, 1], Q[:, 0, 1, 1]], 1)
            else:
                steps[:, 1] = Q[:, 0, 0, 0]
            self._engines[kind] = _engine.MotionLikelihood(
                n_axes=d.n_axes, points=with_noise(d.points, d.covariances)[self._order],
                frames=d.frame_of[self._order], offsets=self._offsets, kind=steps_kind,
                steps=steps,
            )  # fmt: skip
        return self._engines[kind]

    def sums(
        self,
        noises: ArrayLike,
        levels: ArrayLike,
        stays: ArrayLike,
        kind: Kind,
    ) -> NDArray[np.float64]:
        """Return the log likelihood of several motions and noises of one class.

        Parameters
        ----------
        noises : array_like of shape (fits,)
            `MotionFit.noise` of each.
        levels : array_like of shape (fits, modes)
            `MotionFit.levels` of each.
        stays : array_like of shape (fits,)
            `MotionFit.stay` of each.
        kind : {"dwna", "random_walk"}
            Class of the motions.

        Returns
        -------
        ndarray of shape (fits,)
            Sum over the sampled detections, nats.
        """
        squares = np.square(levels)
        return self._engine_of(kind).sums(
            squares=squares,
            transitions=transition_matrices(squares.shape[1], np.asarray(stays)),
            variances=np.square(noises),
            velocity_variance=self._velocity_variance,
        )


def _sample(tracks: Tracks, n_points: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut the tracks into pieces of `PIECE_POINTS` and return evenly spread ones.

    Returns
    -------
    order : ndarray of int, shape (M,)
        Detections of the pieces, one piece after the other.
    offsets : ndarray of int, shape (pieces + 1,)
        First detection of each piece in `order`.
    """
    order, offsets = tracks.by_track
    stride = max(1, round(len(order) / n_points))
    rank = np.arange(len(order)) - np.repeat(offsets[:-1], tracks.lengths)
    is_first = rank % PIECE_POINTS == 0
    if stride > 1:
        is_kept = (np.cumsum(is_first) - 1) % stride == 0
        order, is_first = order[is_kept], is_first[is_kept]
    return order, np.append(np.flatnonzero(is_first), len(order))
