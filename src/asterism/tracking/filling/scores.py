"""Weights and standard deviations of a fill from the estimators' errors in held-out windows.

Symbols: J estimators, H windows, L frames, D axes, C the covariance of the estimators' errors.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.filling.spans import n_apart

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.filling.estimates import Estimates

__all__ = ["Fill", "disagreement_factor", "error_profile", "minimum_variance_weights", "settle"]

MIN_WINDOWS, MIN_APART = 8, 2
"""Smallest number of windows, and of disjoint windows among them."""
OWN_WINDOWS = 0.25
"""Weight of the estimators' own variances, in disjoint windows."""
CAUTION = 4.0
"""Sum of squared log disagreements at which the regression slope has half of its weight; with less
variation the slope stays near its prior of 1."""
MAX_LOG_RATIO = 4.0
"""Largest log ratio of a gap's disagreement to that of the windows."""
TINY = 1e-300


@dataclass(frozen=True, eq=False, kw_only=True)
class Fill:
    """Fill of one gap.

    Parameters
    ----------
    points : ndarray of shape (L, D)
        Filled positions, metres.
    stds : ndarray of shape (L,)
        Standard deviation of a coordinate, metres.
    weights : ndarray of shape (J,)
        Weights of the estimators, with sum 1.
    rms : ndarray of shape (J,)
        Root mean square distance of each estimator in the windows, metres; NaN with too few
        windows.
    n_windows : int
        Number of disjoint windows; 0 if there are too few.
    """

    points: NDArray[np.float64]
    stds: NDArray[np.float64]
    weights: NDArray[np.float64]
    rms: NDArray[np.float64]
    n_windows: int


def settle(found: Estimates) -> Fill:
    """Combine the estimators by their errors in the windows, with a standard deviation.

    Parameters
    ----------
    found : Estimates
        Estimates of the gap and of the windows.

    Returns
    -------
    Fill
    """
    values = np.stack([one.values for one in found.each])
    own = np.stack([one.variances for one in found.each])
    H, L, _ = found.truth.shape
    n = n_apart(found.windows, L)
    if H < MIN_WINDOWS or n < MIN_APART:
        return _by_own_variance(values[:, -1], own)
    errors = values[:, :-1] - found.truth
    weights = minimum_variance_weights(errors)
    mixed = np.einsum("j,jhld->hld", weights, values)
    off = np.einsum("j,jhld->hld", weights, errors)
    held_out = _smoothed(error_profile(off))
    variances = (n * held_out + OWN_WINDOWS * (weights @ own)) / (n + OWN_WINDOWS)
    return Fill(
        points=mixed[-1],
        stds=np.sqrt(variances)
        * disagreement_factor(values - mixed, off / np.sqrt(held_out + TINY)[:, None]),
        weights=weights,
        rms=np.sqrt(np.nanmean((errors**2).sum(axis=3), axis=(1, 2))),
        n_windows=n,
    )


def _by_own_variance(values: NDArray[np.float64], own: NDArray[np.float64]) -> Fill:
    """Return the estimate with the smallest own variance, inflated by the others' disagreement.

    The smoother, which is the first, is used only without others: over a gap that is long for its
    capture its variance is too small.
    """
    J = len(own)
    candidates = np.arange(J)[min(1, J - 1) :]
    best = int(candidates[np.argmin(own[candidates].mean(axis=1))])
    apart = ((values[candidates] - values[best]) ** 2).mean(axis=(0, 2))
    return Fill(
        points=values[best],
        stds=np.sqrt(own[best] + _smoothed(apart)),
        weights=np.eye(J)[best],
        rms=np.full(J, np.nan),
        n_windows=0,
    )


def minimum_variance_weights(errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights ≥ 0 with sum 1 of the minimum-variance mean: ``C⁻¹1 / 1ᵀC⁻¹1``.

    Every subset of the estimators is tried; the best one without a negative weight is used.

    Parameters
    ----------
    errors : ndarray of shape (J, H, L, D)
        Errors of each estimator in the windows, metres; NaN without a true position.

    Returns
    -------
    ndarray of shape (J,)
    """
    J = len(errors)
    flat = errors.reshape(J, -1)
    flat = flat[:, np.isfinite(flat[0])]
    C = flat @ flat.T / flat.shape[1]
    C += 1e-3 * np.diag(np.diag(C)) + TINY * np.eye(J)
    scale = np.sqrt(np.diag(C))  # errors can differ by a factor of millions
    chosen = np.array(list(itertools.product((0.0, 1.0), repeat=J))[1:])
    # An estimator that is not chosen has a row and a column of its own.
    both = chosen[:, :, None] * chosen[:, None, :]
    own = C / np.outer(scale, scale) * both + np.eye(J) * (1 - chosen)[:, None]
    w = np.linalg.solve(own, (chosen / scale)[..., None])[..., 0] / scale
    precision = np.where((w >= 0).all(axis=1), w.sum(axis=1), 0)
    best = int(np.argmax(precision))
    return w[best] / precision[best]


def error_profile(off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean square error of a coordinate in each missing frame, shape (L,).

    A frame that no window covers is interpolated from the frames around it.

    Parameters
    ----------
    off : ndarray of shape (H, L, D)
        Errors in the windows, metres; NaN without a true position.

    Returns
    -------
    ndarray of shape (L,)
        Mean squares, m².
    """
    every = np.arange(off.shape[1])
    is_known = np.isfinite(off[..., 0])
    n = is_known.sum(axis=0)
    total = np.nansum((off**2).mean(axis=2), axis=0)
    return np.interp(every, every[n > 0], total[n > 0] / n[n > 0])


def _smoothed(profile: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the running mean over an eighth of the gap, which suppresses random variation."""
    k = len(profile) // 16
    padded = np.pad(profile, k, mode="edge")
    total = np.concatenate([[0], np.cumsum(padded)])
    return np.maximum((total[2 * k + 1 :] - total[: -2 * k - 1]) / (2 * k + 1), 0)


def disagreement_factor(apart: NDArray[np.float64], z: NDArray[np.float64]) -> float:
    """Return the factor on the errors that follows from the estimators' disagreement in the gap.

    The log error of a window is regressed on the log disagreement of the estimators, with a prior
    slope of 1.

    Parameters
    ----------
    apart : ndarray of shape (J, H + 1, L, D)
        Differences of the estimates from their mean, in the windows and, last, in the gap.
    z : ndarray of shape (H, L, D)
        Errors in the windows, relative to their usual size; NaN without a true position.

    Returns
    -------
    float
    """
    spread = np.log((apart**2).mean(axis=(0, 2, 3)) + TINY) / 2
    square = np.nanmean(z**2, axis=(1, 2))
    if len(apart) < 2 or not (square > 0).all():
        return 1.0
    x, y = spread - spread[:-1].mean(), np.log(square) / 2
    slope = (x[:-1] @ (y - y.mean()) + CAUTION) / (x[:-1] @ x[:-1] + CAUTION)
    factors = np.exp(slope * x.clip(-MAX_LOG_RATIO, MAX_LOG_RATIO))
    # The factor is normalised so that the windows as a whole keep their mean square error.
    return float(factors[-1] * np.sqrt((square / factors[:-1] ** 2).mean() / square.mean()))
