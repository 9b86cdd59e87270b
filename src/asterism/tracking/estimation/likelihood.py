"""The likelihood of motion and noise, given tracks: what a fit of the motion maximises.

Equal to `asterism.filter.predictive_log_densities`. All that does not depend on the fit is prepared
once, because a fit evaluates the likelihood some hundred times.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model import DWNA, Detections, RandomWalk, Tracks
from asterism.model.compiled import steps_of, with_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.estimation.motion_fit import MotionFit

__all__ = ["TrackLikelihood"]

SAMPLE_POINTS = 4000
"""Detections, in pieces of tracks spread evenly over the capture, that the likelihood is of."""
PIECE_POINTS = 60
UNITS = {"dwna": DWNA(acceleration_sigma=1.0), "random_walk": RandomWalk(walk_sigma=1.0)}
"""Motions whose process noise is multiplied by the square of a level."""


class TrackLikelihood:
    """Mean log density of a detection given the earlier ones of its track.

    Parameters
    ----------
    tracks : list of Tracks
        Tracks of runs of frames; about `SAMPLE_POINTS` of their detections are used.
    velocity_sigma : float
        Prior standard deviation of a velocity coordinate, m/s.
    """

    def __init__(self, tracks: list[Tracks], velocity_sigma: float) -> None:
        sample = _sample(tracks)
        d = sample.detections
        self.n_links = int((sample.lengths - 1).sum())
        self.n_points = d.n_points
        self._n_axes = d.n_axes
        self._velocity_sigma = velocity_sigma
        self._steps = {kind: steps_of(unit, d.times) for kind, unit in UNITS.items()}
        self._order, offsets = sample.by_track
        points = with_noise(d.points, d.covariances)[self._order]
        self._data = points, d.frame_of[self._order], offsets, d.times

    def mean(self, fit: MotionFit) -> float:
        """Return the mean over all detections of the sample under a motion and a noise."""
        unit = UNITS[fit.kind]
        kind, F, Q = self._steps[fit.kind]
        shape = (len(F), len(fit.levels), *F.shape[2:])
        model = _engine.MotionModel.make(
            self._n_axes,
            unit.observation,
            unit.initial_covariance(fit.noise, self._velocity_sigma),
            fit.noise,
            fit.transitions,
        )
        squares = np.array([level**2 for level in fit.levels])
        densities = np.zeros(self.n_points)
        densities[self._order] = _engine.foresee_tracks(
            model, *self._data, kind, np.broadcast_to(F, shape).copy(), squares[:, None, None] * Q
        )
        return float(densities.mean())


def _sample(tracks: list[Tracks]) -> Tracks:
    """Cut the tracks into pieces of `PIECE_POINTS` and give evenly spread ones, as one capture.

    The runs of frames are laid one after the other; no piece of a track reaches from one to the
    next, so what lies between them does not matter.
    """
    total = sum(int(found.lengths.sum()) for found in tracks)
    stride = max(1, round(total / SAMPLE_POINTS))
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
