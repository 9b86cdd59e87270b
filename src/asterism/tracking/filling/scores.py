"""How far estimates are off where the truth is known: what to make of them, and how sure it is.

Symbols: J estimators, H windows, L frames, D axes, C the covariance of their errors.
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

LEAST_WINDOWS, LEAST_APART = 8, 2
"""Windows that are needed, and so many of them may hide nothing that another hides."""
OWN_WINDOWS = 0.25
"""What estimators say of themselves counts for this part of a window that is apart."""
CAUTION = 4.0
"""Squared logarithms that it takes to believe half of what the windows tell of disagreement: as
long as they all disagree alike, errors are taken to grow as it does."""
FARTHEST = 4.0
"""Logarithm of how much more or less than the windows a gap can disagree and be believed."""
TINY = 1e-300


@dataclass(frozen=True, eq=False, kw_only=True)
class Fill:
    """A gap filled.

    Parameters
    ----------
    points : ndarray, shape (L, D)
        Metres.
    stds : ndarray, shape (L,)
        Standard deviation of a coordinate, metres.
    weights : ndarray, shape (J,)
        Of the estimators, summing to 1.
    rms : ndarray, shape (J,)
        How far each is off in the windows, root of the mean square distance, metres; NaN where
        there are too few.
    n_windows : int
        Windows of which none hides what another hides; 0 where there are too few to go by.
    """

    points: NDArray[np.float64]
    stds: NDArray[np.float64]
    weights: NDArray[np.float64]
    rms: NDArray[np.float64]
    n_windows: int


def settle(found: Estimates) -> Fill:
    """Weigh the estimators by their errors in the windows, and say how far the fill may be off."""
    values = np.stack([one.values for one in found.each])
    own = np.stack([one.variances for one in found.each])
    H, L, _ = found.truth.shape
    n = n_apart(found.windows, L)
    if H < LEAST_WINDOWS or n < LEAST_APART:
        return _at_their_word(values[:, -1], own)
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


def _at_their_word(values: NDArray[np.float64], own: NDArray[np.float64]) -> Fill:
    """Take the estimator that is surest of itself, and doubt it where another says otherwise.

    The first, the smoother, is not asked where there are others: over a gap that is long for its
    take it is sure of what it cannot know.
    """
    J = len(own)
    asked = np.arange(J)[min(1, J - 1) :]
    best = int(asked[np.argmin(own[asked].mean(axis=1))])
    apart = ((values[asked] - values[best]) ** 2).mean(axis=(0, 2))
    return Fill(
        points=values[best],
        stds=np.sqrt(own[best] + _smoothed(apart)),
        weights=np.eye(J)[best],
        rms=np.full(J, np.nan),
        n_windows=0,
    )


def minimum_variance_weights(errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights ≥ 0 summing to 1 whose mean has the least variance: ``C⁻¹1 / 1ᵀC⁻¹1``.

    Of up to three estimators every subset is tried, and the best taken that needs none below 0.
    """
    J = len(errors)
    flat = errors.reshape(J, -1)
    flat = flat[:, np.isfinite(flat[0])]
    C = flat @ flat.T / flat.shape[1]
    C += 1e-3 * np.diag(np.diag(C)) + TINY * np.eye(J)
    best, least = np.eye(J)[int(np.argmin(np.diag(C)))], np.inf
    for n in range(1, J + 1):
        for chosen in map(list, itertools.combinations(range(J), n)):
            scale = np.sqrt(np.diag(C)[chosen])  # errors may differ by a factor of millions
            w = np.linalg.solve(C[np.ix_(chosen, chosen)] / np.outer(scale, scale), 1 / scale)
            w /= scale
            if (w >= 0).all() and 1 / w.sum() < least:
                least = 1 / w.sum()
                best = np.zeros(J)
                best[chosen] = w / w.sum()
    return best


def error_profile(off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square error of a coordinate in each hidden frame, shape (L,).

    Where no window knows the truth, by the frames around it.
    """
    every = np.arange(off.shape[1])
    is_known = np.isfinite(off[..., 0])
    n = is_known.sum(axis=0)
    total = np.nansum((off**2).mean(axis=2), axis=0)
    return np.interp(every, every[n > 0], total[n > 0] / n[n > 0])


def _smoothed(profile: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the running mean over an eighth of the gap, so that chance makes no waves."""
    k = len(profile) // 16
    padded = np.pad(profile, k, mode="edge")
    total = np.concatenate([[0], np.cumsum(padded)])
    return np.maximum((total[2 * k + 1 :] - total[: -2 * k - 1]) / (2 * k + 1), 0)


def disagreement_factor(apart: NDArray[np.float64], z: NDArray[np.float64]) -> float:
    """How much farther off this fill may be than the windows: as the estimators disagree more.

    The log of a window's error is regressed on the log of how far the estimators are apart; before
    any window is seen the slope is 1.

    Parameters
    ----------
    apart : ndarray, shape (J, H + 1, L, D)
        Estimates from their mean, in the windows and, last, in the gap.
    z : ndarray, shape (H, L, D)
        Errors in the windows, relative to their usual size; NaN where the truth is not known.
    """
    spread = np.log((apart**2).mean(axis=(0, 2, 3)) + TINY) / 2
    square = np.nanmean(z**2, axis=(1, 2))
    if len(apart) < 2 or not (square > 0).all():
        return 1.0
    x, y = spread - spread[:-1].mean(), np.log(square) / 2
    slope = (x[:-1] @ (y - y.mean()) + CAUTION) / (x[:-1] @ x[:-1] + CAUTION)
    factors = np.exp(slope * x.clip(-FARTHEST, FARTHEST))
    # The windows as a whole must come out with their own mean square.
    return float(factors[-1] * np.sqrt((square / factors[:-1] ** 2).mean() / square.mean()))
