"""Maximum-likelihood fit of motion and noise to tracks.

The likelihood is that of the filter used for tracking: the log densities of the innovations are
summed over the tracks and maximised by a quasi-Newton method. A marker has one motion (DWNA or a
random walk), or switches between three DWNA: quiet, busy, and the short jolts of impacts, which one
motion would lose. The observed information yields the standard deviations of the parameters.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.records import record
from asterism.tracking.estimation.fitted_motion import Kind, MotionFit
from asterism.tracking.estimation.likelihood import TrackLikelihood
from asterism.tracking.estimation.quasi_newton import maximise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks

    _Values = tuple[float, tuple[float, ...], float]
    """Noise, levels and `MotionFit.stay`."""

__all__ = ["MIN_GAIN", "FitBounds", "fit_motion", "fit_one_motion", "polish"]

KINDS: tuple[Kind, ...] = ("dwna", "random_walk")
SEARCH_POINTS, FIT_POINTS = 1500, 4000
"""Numbers of detections in the likelihood of a search from afar, and of a fit."""
MIN_RATIO = math.log(2)
"""Smallest logarithm of the ratio of two levels. The likelihood has further maxima at equal levels,
at which the noise has to explain the quiet motion."""
STAY = (-1.0, 7.0)
"""Bounds of the log odds that a marker stays quiet, or busy, for another frame."""
MIN_GAIN = 0.05
"""Smallest gain of a motion over a simpler one, nats per detection. The few wrong links in tracks
look like jolts to the fit; on their own they gain less than this."""
ROUGH = 0.1
"""Step of a logarithm over which the likelihood of several motions is assumed to be smooth."""
MAX_NEWTON_STEP = 0.3
"""Largest Newton step of a logarithm towards the maximum of the likelihood."""
FLAT = 1e-10
"""Ratio of curvatures below which a parameter has no maximum to double precision."""


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

    def clip(self, fit: MotionFit) -> MotionFit:
        """Return a fit limited to the bounds.

        Parameters
        ----------
        fit : MotionFit
            Motion and noise.

        Returns
        -------
        MotionFit
        """
        levels = fit.levels
        if fit.kind == "dwna":
            levels = tuple(min(level, self.max_acceleration) for level in levels)
        return replace(fit, noise=max(fit.noise, self.min_noise), levels=levels)


def fit_motion(
    tracks: Tracks,
    model: TrackingModel,
    start: MotionFit,
    bounds: FitBounds,
    *,
    refine: bool = False,
) -> MotionFit:
    """Fit three motions and the noise to tracks.

    Parameters
    ----------
    tracks : Tracks
        Tracks of runs of consecutive frames.
    model : TrackingModel
        Model for the filter; its motion and noise are replaced.
    start : MotionFit
        Start of the search.
    bounds : FitBounds
        Bounds of noise and motion.
    refine : bool
        Whether `start` is a fit to earlier tracks. The search then uses a larger sample of the
        detections.

    Returns
    -------
    MotionFit
    """

    def unpack(x: list[float]) -> _Values:
        noise, jolt, busy, quiet, odds = x
        levels = math.exp(jolt - busy - quiet), math.exp(jolt - busy), math.exp(jolt)
        return math.exp(noise), levels, 1 / (1 + math.exp(-odds))

    quiet, busy, jolt = map(math.log, start.levels)
    odds = math.log(start.stay / (1 - start.stay))
    first = [math.log(start.noise), jolt, jolt - busy, busy - quiet, odds]
    limits = [
        (math.log(bounds.min_noise), math.inf),
        (-math.inf, math.log(bounds.max_acceleration)),
        (MIN_RATIO, math.inf),
        (MIN_RATIO, math.inf),
        STAY,
    ]
    likelihood = _likelihood(tracks, model, FIT_POINTS if refine else SEARCH_POINTS)
    return bounds.clip(_search(likelihood, unpack, "dwna", first, limits)[0])


def fit_one_motion(
    tracks: Tracks, model: TrackingModel, start: MotionFit, bounds: FitBounds
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
    velocity = model.velocity_sigma(tracks.detections.n_axes)
    likelihood = _likelihood(tracks, model, FIT_POINTS)
    middle = math.log(start.levels[len(start.levels) // 2])
    best, best_gain = start, -math.inf

    def unpack(x: list[float]) -> _Values:
        noise, level = x
        return math.exp(noise), (math.exp(level),), 1.0

    for kind in KINDS:
        level = middle
        if kind == "random_walk":
            level = math.log(velocity) + math.log(tracks.detections.step or 1.0) / 2
        first = [math.log(start.noise), level]
        top = math.inf if kind == "random_walk" else math.log(bounds.max_acceleration)
        limits = [(math.log(bounds.min_noise), math.inf), (-math.inf, top)]
        plain, gain = _search(likelihood, unpack, kind, first, limits)
        if gain > best_gain + MIN_GAIN:
            best, best_gain = bounds.clip(plain), gain
    return best


def polish(
    tracks: Tracks, model: TrackingModel, fit: MotionFit, bounds: FitBounds
) -> tuple[MotionFit, tuple[float, ...]]:
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
    stds : tuple of float
        Standard deviations of the logarithms of the noise and of each level, from the inverse of
        the observed information; NaN for a parameter on which the likelihood has no maximum.
    """
    likelihood = _likelihood(tracks, model, FIT_POINTS)
    first = np.log([fit.noise, *fit.levels])

    def at(x: NDArray[np.float64]) -> MotionFit:
        noise, *levels = map(float, np.exp(x))
        return replace(fit, noise=noise, levels=tuple(levels))

    def costs(points: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        values = np.exp(points)
        stays = np.full(len(values), fit.stay)
        return -likelihood.sums(values[:, 0], values[:, 1:], stays, fit.kind)

    # The step is about one standard deviation. With several motions the likelihood is rough at
    # that scale, because links that no mode predicts change from mode to mode.
    h = 1 / math.sqrt(likelihood.n_links) if len(fit.levels) == 1 else ROUGH
    n = len(first)
    steps = h * np.eye(n)
    pairs = list(zip(*np.tril_indices(n, -1), strict=True))
    corners = [steps[a] + steps[b] for a, b in pairs]
    middle, *others = costs(
        [first, *(first + sign * e for sign in (1, -1) for e in [*steps, *corners])]
    )
    up, up_up, down, down_down = np.split(np.array(others), np.cumsum([n, len(pairs), n]))
    gradient = (up - down) / (2 * h)
    information: NDArray[Any] = np.diag(up - 2 * middle + down)
    for k, (a, b) in enumerate(pairs):
        sides = up[a] + down[a] + up[b] + down[b] - 2 * middle
        information[a, b] = information[b, a] = (up_up[k] + down_down[k] - sides) / 2
    information = information / h**2
    stds, step = np.full(n, np.nan), np.zeros(n)
    own = _determined(information)
    within = information[np.ix_(own, own)]
    stds[own] = np.sqrt(np.diag(np.linalg.inv(within)))
    step[own] = np.linalg.solve(within, gradient[own])
    if np.abs(step).max() > MAX_NEWTON_STEP or costs([first - step])[0] > middle:
        return fit, tuple(map(float, stds))
    return bounds.clip(at(first - step)), tuple(map(float, stds))


def _determined(information: NDArray[np.float64]) -> NDArray[np.int64]:
    """Select the parameters for which the likelihood has a maximum, the others being fixed.

    Of several motions, levels may be fixed that the tracks do not determine, as that of jolts in
    tracks without any: they hardly correlate with the other parameters. The noise and the level of
    a single motion do, so without a maximum neither is determined.

    Parameters
    ----------
    information : ndarray of shape (n, n)
        Observed information of the noise and of each level.

    Returns
    -------
    ndarray of int, shape (m,)
        Parameters whose information is positive definite.
    """
    none = np.arange(0)
    own = np.flatnonzero(np.isfinite(information).all(axis=1))
    while len(own) > 1 and own[0] == 0:
        curvatures, directions = np.linalg.eigh(information[np.ix_(own, own)])
        if curvatures[0] > FLAT * curvatures[-1]:
            return own
        flattest = int(np.argmax(np.abs(directions[:, 0])))
        if flattest == 0 or len(information) == 2:
            return none
        own = np.delete(own, flattest)
    return none


def _likelihood(tracks: Tracks, model: TrackingModel, n_points: int) -> TrackLikelihood:
    return TrackLikelihood(tracks, model.velocity_sigma(tracks.detections.n_axes), n_points)


def _search(
    likelihood: TrackLikelihood,
    unpack: Callable[[list[float]], _Values],
    kind: Kind,
    first: list[float],
    limits: list[tuple[float, float]],
) -> tuple[MotionFit, float]:
    """Return the most likely motion, and its log likelihood in nats per detection."""

    def likelihoods(points: NDArray[np.float64]) -> NDArray[np.float64]:
        noises, levels, stays = zip(*map(unpack, points.tolist()), strict=True)
        return likelihood.sums(noises, levels, stays, kind)

    low, high = np.array(limits).T
    x, value = maximise(likelihoods, np.array(first), low, high)
    noise, levels, stay = unpack(x.tolist())
    best = MotionFit(noise=noise, levels=levels, stay=stay, kind=kind)
    return best, value / likelihood.n_points
