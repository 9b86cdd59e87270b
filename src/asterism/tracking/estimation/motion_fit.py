"""Maximum-likelihood fit of motion and noise to tracks.

The likelihood is that of the filter used for tracking: the log densities of the innovations are
summed over the tracks and maximised by a simplex search. A marker has one motion (DWNA or a random
walk), or switches between three DWNA: quiet, busy, and the short jolts of impacts, which one motion
would lose. The observed information yields the standard deviations of the parameters.
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

__all__ = ["MIN_GAIN", "FitBounds", "MotionFit", "fit_motion", "fit_one_motion", "polish"]

Kind = Literal["dwna", "random_walk"]
KINDS: tuple[Kind, ...] = ("dwna", "random_walk")
SEARCH_POINTS, FIT_POINTS = 1500, 4000
"""Numbers of detections in the likelihood of a search from afar, and of a fit."""
REFINED = 0.4
"""Size of the first steps of a search near the maximum, relative to those of one from afar."""
MIN_GAIN = 0.05
"""Smallest gain of a motion over a simpler one, nats per detection. The few wrong links in tracks
look like jolts to the fit; on their own they gain less than this."""
ROUGH = 0.1
"""Step of a logarithm over which the likelihood of several motions is assumed to be smooth."""
MAX_NEWTON_STEP = 0.3
"""Largest Newton step of a logarithm towards the maximum of the likelihood."""
FLAT = 1e-10
"""Ratio of curvatures below which the likelihood has no maximum to double precision."""
JOLT = 0.1
"""Share of jolts among the transitions from quiet or busy; a jolt lasts two frames on average."""


@record
class MotionFit:
    """Fitted motion and noise.

    Parameters
    ----------
    noise : float
        σ, standard deviation of a measured coordinate, metres.
    levels : tuple of float
        Strength of each mode. DWNA: σ_a, m/s², of one mode or increasing of three (quiet, busy,
        jolt). Random walk: σ_w, m/√s, of one mode.
    stay : float
        Probability that a marker stays quiet, or busy, for another frame; 1 for one mode.
    kind : {"dwna", "random_walk"}
        Class of the motion.
    """

    noise: float
    levels: tuple[float, ...]
    stay: float = 1.0
    kind: Kind = "dwna"

    @property
    def transitions(self) -> NDArray[np.float64]:
        """Probability of switching from mode (row) to mode (column) in a step."""
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
        """Return the motion model.

        Parameters
        ----------
        velocity_sigma : float
            Prior standard deviation of a velocity coordinate, m/s.

        Returns
        -------
        Motion
        """
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
    """Bounds of the fitted noise and motion.

    Parameters
    ----------
    min_noise : float
        Lower bound of σ, metres.
    max_acceleration : float
        Upper bound of σ_a of any mode, m/s². A jolt over much of the distance to a neighbour
        cannot be distinguished from a wrong link, so no jolt may be estimated from one.
    """

    min_noise: float
    max_acceleration: float

    def fit(self, log_noise: float, log_levels: tuple[float, ...], stay: float) -> MotionFit:
        """Return the fit with these parameters, limited to the bounds.

        Parameters
        ----------
        log_noise : float
            Logarithm of σ in metres.
        log_levels : tuple of float
            Logarithm of σ_a in m/s² for each mode.
        stay : float
            As for `MotionFit`.

        Returns
        -------
        MotionFit
        """
        return MotionFit(
            noise=max(math.exp(log_noise), self.min_noise),
            levels=tuple(min(math.exp(x), self.max_acceleration) for x in log_levels),
            stay=stay,
        )


def fit_motion(
    tracks: list[Tracks],
    model: TrackingModel,
    start: MotionFit,
    bounds: FitBounds,
    *,
    refine: bool = False,
) -> MotionFit:
    """Fit three motions and the noise to tracks.

    Parameters
    ----------
    tracks : list of Tracks
        Tracks of runs of consecutive frames.
    model : TrackingModel
        Model for the filter; its motion and noise are replaced.
    start : MotionFit
        Start of the search.
    bounds : FitBounds
        Bounds of noise and motion.
    refine : bool
        Whether `start` is a fit to earlier tracks. The search then has smaller steps and a larger
        sample of the detections.

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
    likelihood = _likelihood(tracks, model, FIT_POINTS if refine else SEARCH_POINTS)
    spread = (REFINED if refine else 1) * np.array([0.4, 0.4, 0.4, 0.4, 0.8])
    return _search(likelihood, unpack, first, spread)[0]


def fit_one_motion(
    tracks: list[Tracks], model: TrackingModel, start: MotionFit, bounds: FitBounds
) -> MotionFit:
    """Fit one motion of each class to tracks, and return the best fit.

    A random walk must gain `MIN_GAIN`. DWPA is excluded: on smoothed captures it predicts the next
    frame better, but loses the track in every gap.

    Parameters
    ----------
    tracks, model, start, bounds
        As for `fit_motion`.

    Returns
    -------
    MotionFit
    """
    velocity = model.velocity_sigma(tracks[0].detections.n_axes)
    likelihood = _likelihood(tracks, model, FIT_POINTS)
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
        first = [math.log(start.noise), level]
        plain, cost = _search(likelihood, unpack, first, np.array([0.4, 0.7]))
        if cost < best_cost - MIN_GAIN:
            best, best_cost = plain, cost
    return best


def polish(
    tracks: list[Tracks], model: TrackingModel, fit: MotionFit, bounds: FitBounds
) -> tuple[MotionFit, tuple[float, ...] | None]:
    """Refine a fit by a Newton step, and estimate the standard deviations of its parameters.

    Parameters
    ----------
    tracks, model, bounds
        As for `fit_motion`.
    fit : MotionFit
        Fit to refine.

    Returns
    -------
    fit : MotionFit
        Fit at the maximum, within the bounds.
    stds : tuple of float or None
        Standard deviations of the logarithms of the noise and of each level, from the inverse of
        the observed information; None if the likelihood has no maximum.
    """
    likelihood = _likelihood(tracks, model, FIT_POINTS)
    first = np.log([fit.noise, *fit.levels])

    def at(x: NDArray[np.float64]) -> MotionFit:
        noise, *levels = map(float, np.exp(x))
        return replace(fit, noise=noise, levels=tuple(levels))

    def cost(x: NDArray[np.float64]) -> float:
        return -likelihood.n_points * likelihood.mean(at(x))

    # The step is about one standard deviation. With several motions the likelihood is rough at
    # that scale, because links that no mode predicts change from mode to mode.
    h = 1 / math.sqrt(likelihood.n_links) if len(fit.levels) == 1 else ROUGH
    steps = h * np.eye(len(first))
    middle = cost(first)
    up, down = (np.array([cost(first + sign * e) for e in steps]) for sign in (1, -1))
    gradient = (up - down) / (2 * h)
    information: NDArray[Any] = np.diag(up - 2 * middle + down)
    for a, b in zip(*np.tril_indices(len(first), -1), strict=True):
        corners = cost(first + steps[a] + steps[b]) + cost(first - steps[a] - steps[b])
        sides = up[a] + down[a] + up[b] + down[b] - 2 * middle
        information[a, b] = information[b, a] = (corners - sides) / 2
    information = information / h**2
    if not np.isfinite(information).all():
        return fit, None
    curvatures = np.linalg.eigvalsh(information)
    if curvatures[0] <= FLAT * curvatures[-1]:
        return fit, None
    stds = tuple(map(float, np.sqrt(np.diag(np.linalg.inv(information)))))
    step = np.linalg.solve(information, gradient).astype(np.float64)
    if np.abs(step).max() > MAX_NEWTON_STEP or cost(first - step) > middle:
        return fit, stds
    summit = at(first - step)
    return replace(
        summit,
        noise=max(summit.noise, bounds.min_noise),
        levels=summit.levels
        if fit.kind == "random_walk"
        else tuple(min(a, bounds.max_acceleration) for a in summit.levels),
    ), stds


def _likelihood(tracks: list[Tracks], model: TrackingModel, n_points: int) -> TrackLikelihood:
    return TrackLikelihood(tracks, model.velocity_sigma(tracks[0].detections.n_axes), n_points)


def _search(
    likelihood: TrackLikelihood,
    unpack: Callable[[NDArray[np.float64]], MotionFit],
    first: list[float],
    spread: NDArray[np.float64],
) -> tuple[MotionFit, float]:
    from scipy.optimize import minimize

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
