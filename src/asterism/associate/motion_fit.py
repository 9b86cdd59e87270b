"""Motion and noise that make tracks most likely one step ahead.

Maximum likelihood through the very filter that will be used: the log densities of the innovations
are summed over the tracks and climbed by a simplex search. A marker may have one DWNA motion, or
change between three: quiet, busy, and the short jolts of an impact that would otherwise lose it.
The Bayesian information criterion decides (Schwarz 1978).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.filter import filter_states
from asterism.model import DWNA, InteractingMotions, Motion, TrackingModel, Tracks

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["FitBounds", "MotionFit", "fit_motion", "simpler_motion"]

FIT_POINTS = 5000
"""Detections, in whole tracks' pieces spread over the clip, on which the likelihood is computed."""
PIECE_POINTS = 60
JOLT = 0.1
"""Of the changes from quiet or busy, the share that are jolts; a jolt lasts two frames."""


@dataclass(frozen=True, kw_only=True)
class MotionFit:
    """The most likely motion.

    Parameters
    ----------
    noise : float
        σ, metres.
    levels : tuple of float
        σ_a of each motion, m/s², rising; one or three: quiet, busy, jolt.
    stay : float
        Probability that a marker stays quiet, or busy, for another frame; 1 with one motion.
    """

    noise: float
    levels: tuple[float, ...]
    stay: float

    def motion(self, velocity_sigma: float) -> Motion:
        """Make the motion model; `velocity_sigma` is the prior of a velocity coordinate, m/s."""
        models = tuple(
            DWNA(acceleration_sigma=a, velocity_sigma=velocity_sigma) for a in self.levels
        )
        if len(models) == 1:
            return models[0]
        return InteractingMotions(models=models, transitions=_transitions(self.stay))


@dataclass(frozen=True, kw_only=True)
class FitBounds:
    """What is believed of noise and motion, whatever the tracks say.

    Parameters
    ----------
    least_noise : float
        σ is at least this, metres.
    most_acceleration : float
        σ_a of any motion is at most this, m/s². A jolt that carries a marker a good part of the
        way to its neighbour cannot be told from a wrong link, and must not be learnt from one.
    """

    least_noise: float
    most_acceleration: float

    def fit(self, log_noise: float, log_levels: tuple[float, ...], stay: float) -> MotionFit:
        """Make a fit within the bounds."""
        return MotionFit(
            noise=max(math.exp(log_noise), self.least_noise),
            levels=tuple(min(math.exp(x), self.most_acceleration) for x in log_levels),
            stay=stay,
        )


def _transitions(stay: float) -> NDArray[np.float64]:
    leave = 1 - stay
    return np.array(
        [
            [stay, (1 - JOLT) * leave, JOLT * leave],
            [(1 - JOLT) * leave, stay, JOLT * leave],
            [0.25, 0.25, 0.5],
        ]
    )


def fit_motion(
    tracks: list[Tracks], model: TrackingModel, start: MotionFit, bounds: FitBounds
) -> MotionFit:
    """Fit three motions and the noise to tracks.

    Parameters
    ----------
    tracks : list of Tracks
        Tracks of runs of frames.
    model : TrackingModel
        What else the filter needs; its motion and noise are replaced.
    start : MotionFit
        Where the search begins.
    bounds : FitBounds
        What is believed at least and at most.

    Returns
    -------
    MotionFit
    """

    def unpack(x: NDArray[np.float64]) -> MotionFit:
        busy = x[1] + abs(x[2])
        return bounds.fit(
            x[0],
            (x[1], busy, busy + abs(x[3])),
            1 / (1 + math.exp(-min(max(x[4], -1.0), 7.0))),
        )

    log_levels = np.log(start.levels)
    first = [
        math.log(start.noise),
        log_levels[0],
        log_levels[1] - log_levels[0],
        log_levels[2] - log_levels[1],
        math.log(start.stay / (1 - start.stay)),
    ]
    return _search(tracks, model, unpack, first, [0.4, 0.4, 0.4, 0.4, 0.8])[0]


def simpler_motion(
    tracks: list[Tracks], model: TrackingModel, fit: MotionFit, bounds: FitBounds
) -> MotionFit:
    """Give one motion in place of three if it explains the tracks as well (by the BIC)."""

    def unpack(x: NDArray[np.float64]) -> MotionFit:
        return bounds.fit(x[0], (x[1],), 1.0)

    first = [math.log(fit.noise), math.log(fit.levels[1])]
    plain, cost, n = _search(tracks, model, unpack, first, [0.4, 0.7])
    mixed_cost = _cost(_samples(tracks), model, fit) * n
    return plain if cost * n < mixed_cost + 0.5 * 3 * math.log(n) else fit


def _search(
    tracks: list[Tracks],
    model: TrackingModel,
    unpack: Callable[[NDArray[np.float64]], MotionFit],
    first: list[float],
    spread: list[float],
) -> tuple[MotionFit, float, int]:
    from scipy.optimize import minimize

    samples = _samples(tracks)

    def cost(x: NDArray[np.float64]) -> float:
        return _cost(samples, model, unpack(x))

    found = minimize(
        cost,
        np.array(first),
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([first, first + np.diag(spread)]),
            "maxiter": 70,
            "xatol": 0.03,
            "fatol": 3e-3,
        },
    )
    return unpack(found.x), float(found.fun), sum(int((s.labels >= 0).sum()) for s in samples)


def _cost(samples: list[Tracks], model: TrackingModel, fit: MotionFit) -> float:
    """Minus the mean log density of a detection given the earlier ones of its track."""
    trial = replace(
        model,
        motion=fit.motion(model.velocity_sigma(samples[0].detections.n_axes)),
        sensor=replace(model.sensor, noise_sigma=fit.noise),
    )
    n = max(sum(int((s.labels >= 0).sum()) for s in samples), 1)
    return -sum(float(filter_states(s, trial).log_densities.sum()) for s in samples) / n


def _samples(tracks: list[Tracks]) -> list[Tracks]:
    """Cut the tracks into pieces of `PIECE_POINTS` and keep evenly spread ones."""
    cut: list[NDArray[np.int64]] = []
    total = 0
    for found in tracks:
        order, _ = found.by_track
        label = found.labels[order]
        begins = np.concatenate([[True], np.diff(label) != 0]) if len(order) else np.empty(0, bool)
        start = np.maximum.accumulate(np.where(begins, np.arange(len(order)), 0))
        begins |= (np.arange(len(order)) - start) % PIECE_POINTS == 0
        pieces = np.full(len(found.labels), -1, dtype=np.int64)
        pieces[order] = np.cumsum(begins) - 1
        cut.append(pieces)
        total += len(order)
    stride = max(1, round(total / FIT_POINTS))
    samples: list[Tracks] = []
    for found, pieces in zip(tracks, cut, strict=True):
        kept = np.where((pieces >= 0) & (pieces % stride == 0), pieces // stride, -1)
        samples.append(Tracks(detections=found.detections, labels=kept))
    return samples
