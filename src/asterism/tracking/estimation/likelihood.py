"""Likelihood of motion and noise given tracks, the objective of the motion fit.

It equals the sum of `asterism.filter.filter_states(...).log_densities`. The engine holds the data
and evaluates several fits in a call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model import DWNA, Detections, RandomWalk, Tracks
from asterism.model.compiled import steps_of, with_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.tracking.estimation.motion_fit import MotionFit

__all__ = ["TrackLikelihood"]

PIECE_POINTS = 60


class TrackLikelihood:
    """Log density of the detections of tracks, each given the earlier ones of its track.

    Parameters
    ----------
    tracks : list of Tracks
        Tracks of runs of frames.
    velocity_sigma : float
        Prior standard deviation of a velocity coordinate, m/s.
    n_points : int
        Number of detections that are used, about, in pieces of tracks spread over the capture.
    """

    def __init__(self, tracks: list[Tracks], velocity_sigma: float, n_points: int) -> None:
        sample = _sample(tracks, n_points)
        d = sample.detections
        order, offsets = sample.by_track
        points = with_noise(d.points, d.covariances)[order]
        self.n_links = int((sample.lengths - 1).sum())
        self.n_points = d.n_points
        self._velocity_variance = velocity_sigma**2

        def engine(unit: DWNA | RandomWalk) -> _engine.MotionLikelihood:
            kind, F, Q = steps_of(unit, d.times)
            steps = np.zeros((len(F), 4))  # a random walk has no velocity
            if isinstance(unit, DWNA):
                steps[:] = np.stack([F[:, 0, 0, 1], Q[:, 0, 0, 0], Q[:, 0, 0, 1], Q[:, 0, 1, 1]], 1)
            else:
                steps[:, 1] = Q[:, 0, 0, 0]
            return _engine.MotionLikelihood(
                n_axes=d.n_axes, points=points, frames=d.frame_of[order], offsets=offsets,
                kind=kind, steps=steps,
            )  # fmt: skip

        self._engines = {
            "dwna": engine(DWNA(acceleration_sigma=1.0)),
            "random_walk": engine(RandomWalk(walk_sigma=1.0)),
        }

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
        return self._engines[fits[0].kind].sums(
            squares=np.square([fit.levels for fit in fits]),
            transitions=np.array([fit.transitions for fit in fits]),
            variances=np.square([fit.noise for fit in fits]),
            velocity_variance=self._velocity_variance,
        )


def _sample(tracks: list[Tracks], n_points: int) -> Tracks:
    """Cut the tracks into pieces of `PIECE_POINTS` and return evenly spread ones as one capture.

    The runs of frames are placed one after the other. No piece of a track extends over two runs,
    so the time between runs has no effect.
    """
    total = sum(int(found.lengths.sum()) for found in tracks)
    stride = max(1, round(total / n_points))
    times: list[NDArray[np.float64]] = []
    points: list[NDArray[np.float64]] = []
    counts: list[NDArray[np.int64]] = []
    labels: list[NDArray[np.int64]] = []
    noise: list[NDArray[np.float64]] = []
    n_cut = n_kept = 0
    start = 0.0
    for found in tracks:
        d = found.detections
        order, offsets = found.by_track
        rank = np.arange(len(order)) - np.repeat(offsets[:-1], found.lengths)
        cut = np.cumsum(rank % PIECE_POINTS == 0) - 1 + n_cut
        n_cut += len(np.unique(cut))
        piece = np.full(d.n_points, -1, dtype=np.int64)
        piece[order[cut % stride == 0]] = np.unique(cut[cut % stride == 0], return_inverse=True)[1]
        is_kept = piece >= 0
        labels.append(piece[is_kept] + n_kept)
        n_kept += int(piece.max(initial=-1)) + 1
        points.append(d.points[is_kept])
        if d.covariances is not None:
            noise.append(d.covariances[is_kept])
        counts.append(np.bincount(d.frame_of[is_kept], minlength=d.n_frames))
        times.append(d.times - d.times[0] + start)
        start = float(times[-1][-1]) + max(d.step, 1e-6)
    detections = Detections(
        times=np.concatenate(times),
        offsets=np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int64),
        points=np.concatenate(points),
        covariances=np.concatenate(noise) if noise else None,
    )
    return Tracks(detections=detections, labels=np.concatenate(labels))
