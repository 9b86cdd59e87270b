"""Motion and noise that make tracks most likely one step ahead.

Maximum likelihood through the very filter that will be used: the log densities of the innovations
are summed over the tracks and climbed by a simplex search. A marker may have one motion (DWNA
or a random walk), or change between three DWNA: quiet, busy, and the short jolts of an impact that
would otherwise lose it. How sharply the likelihood falls about the parameters tells how sure they
are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from asterism.model import (
    DWNA,
    InteractingMotions,
    Motion,
    RandomWalk,
    TrackingModel,
    Tracks,
)
from asterism.records import record
from asterism.tracking.estimation.likelihood import TrackLikelihood

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["WORTH", "FitBounds", "MotionFit", "fit_motion", "fit_one_motion", "polish"]

Kind = Literal["dwna", "random_walk"]
KINDS: tuple[Kind, ...] = ("dwna", "random_walk")
WORTH = 0.05
"""Nats a detection that a motion must win over a simpler one. The few wrong links that tracks
contain are jolts to the fit; where there are no others they win less than this."""
ROUGH = 0.1
"""Step, of a logarithm, over which the likelihood of several motions is taken for smooth."""
FARTHEST = 0.3
"""Longest step, of a logarithm, that is taken to the summit of a likelihood."""
JOLT = 0.1
"""Of the changes from quiet or busy, the share that are jolts; a jolt lasts two frames."""


@record
class MotionFit:
    """The most likely motion.

    Parameters
    ----------
    noise : float
        σ, metres.
    levels : tuple of float
        One or, of DWNA, three: quiet, busy, jolt. σ_a of DWNA, rising, m/s²; σ_w of a random walk,
        m/√s.
    stay : float
        Probability that a marker stays quiet, or busy, for another frame; 1 with one motion.
    kind : {"dwna", "random_walk"}
        Of motion.
    """

    noise: float
    levels: tuple[float, ...]
    stay: float = 1.0
    kind: Kind = "dwna"

    @property
    def transitions(self) -> NDArray[np.float64]:
        """Probability of changing from motion (row) to motion (column) in a step."""
        if len(self.levels) == 1:
            return np.ones((1, 1))
        leave = 1 - self.stay
        return np.array(
            [
                [self.stay, (1 - JOLT) * leave, JOLT * leave],
                [(1 - JOLT) * leave, self.stay, JOLT * leave],
                [0.25, 0.25, 0.5],
            ]
        )

    def motion(self, velocity_sigma: float) -> Motion:
        """Make the motion model; `velocity_sigma` is the prior of a velocity coordinate, m/s."""
        if self.kind == "random_walk":
            return RandomWalk(walk_sigma=self.levels[0])
        models = tuple(
            DWNA(acceleration_sigma=a, velocity_sigma=velocity_sigma) for a in self.levels
        )
        if len(models) == 1:
            return models[0]
        return InteractingMotions(models=models, transitions=self.transitions)


@record
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


def fit_one_motion(
    tracks: list[Tracks], model: TrackingModel, start: MotionFit, bounds: FitBounds
) -> MotionFit:
    """Fit one motion of each kind to tracks, and give the kind that explains them best.

    A random walk must win `WORTH`. DWPA is left out: on smoothed captures it foresees the next
    frame better, and loses every gap.
    """
    velocity = model.velocity_sigma(tracks[0].detections.n_axes)
    middle = math.log(start.levels[len(start.levels) // 2])
    best, best_cost = start, math.inf
    for kind in KINDS:

        def unpack(x: NDArray[np.float64], kind: Kind = kind) -> MotionFit:
            plain = bounds.fit(x[0], (x[1],), 1.0)
            level = math.exp(x[1]) if kind == "random_walk" else plain.levels[0]
            return replace(plain, levels=(level,), kind=kind)

        level = middle
        if kind == "random_walk":
            level = math.log(velocity) + math.log(tracks[0].detections.step or 1.0) / 2
        plain, cost = _search(tracks, model, unpack, [math.log(start.noise), level], [0.4, 0.7])
        if cost < best_cost - WORTH:
            best, best_cost = plain, cost
    return best


def polish(
    tracks: list[Tracks], model: TrackingModel, fit: MotionFit, bounds: FitBounds
) -> tuple[MotionFit, tuple[float, ...] | None]:
    """Take a Newton step to the summit of the likelihood, and tell how sure the parameters are.

    Returns
    -------
    fit : MotionFit
        At the summit, within the bounds.
    stds : tuple of float or None
        Standard deviations of the logarithms of the noise and of each level, from the inverse of
        the observed information; None where the likelihood has no summit.
    """
    likelihood = TrackLikelihood(tracks, model.velocity_sigma(tracks[0].detections.n_axes))
    first = np.log([fit.noise, *fit.levels])

    def at(x: NDArray[np.float64]) -> MotionFit:
        noise, *levels = map(float, np.exp(x))
        return replace(fit, noise=noise, levels=tuple(levels))

    def cost(x: NDArray[np.float64]) -> float:
        return -likelihood.n_points * likelihood.mean(at(x))

    # About a standard deviation. Of several motions the likelihood is rough at that scale: a link
    # that none of them foresees is taken by one or by another.
    h = 1 / math.sqrt(likelihood.n_links) if len(fit.levels) == 1 else ROUGH
    steps = h * np.eye(len(first))
    middle = cost(first)
    up, down = (np.array([cost(first + sign * e) for e in steps]) for sign in (1, -1))
    gradient = (up - down) / (2 * h)
    information: NDArray[Any] = np.diag(up - 2 * middle + down)
    for a, b in zip(*np.tril_indices(len(first), -1), strict=True):
        corners = [
            s * t * cost(first + s * steps[a] + t * steps[b]) for s in (1, -1) for t in (1, -1)
        ]
        information[a, b] = information[b, a] = sum(corners) / 4
    information = information / h**2
    if not np.isfinite(information).all() or np.linalg.eigvalsh(information)[0] <= 0:
        return fit, None
    stds = tuple(map(float, np.sqrt(np.diag(np.linalg.inv(information)))))
    step = np.linalg.solve(information, gradient).astype(np.float64)
    if np.abs(step).max() > FARTHEST or cost(first - step) > middle:
        return fit, stds
    summit = at(first - step)
    return replace(
        summit,
        noise=max(summit.noise, bounds.least_noise),
        levels=summit.levels
        if fit.kind == "random_walk"
        else tuple(min(a, bounds.most_acceleration) for a in summit.levels),
    ), stds


def _search(
    tracks: list[Tracks],
    model: TrackingModel,
    unpack: Callable[[NDArray[np.float64]], MotionFit],
    first: list[float],
    spread: list[float],
) -> tuple[MotionFit, float]:
    from scipy.optimize import minimize

    likelihood = TrackLikelihood(tracks, model.velocity_sigma(tracks[0].detections.n_axes))

    def cost(x: NDArray[np.float64]) -> float:
        return -likelihood.mean(unpack(x))

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
    return unpack(found.x), float(found.fun)
