"""What other markers say of one: ridge regression within the body, learnt where all were seen.

Symbols: F frames, p features Z, y the marker's place, D axes, G = ZᵀZ, g = Zᵀy, B the weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Pattern", "learn_pattern"]

MOST_FOLDS = 8
RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Strengths that are tried, in mean variances of a feature."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pattern:
    """How a marker's place follows from those of others.

    Parameters
    ----------
    by_fold : ndarray, shape (folds, F, D)
        Its place by what was learnt without each fold.
    by_all : ndarray, shape (F, D)
        Its place by all that was learnt.
    fold : ndarray of int, shape (F,)
        Which fold each frame is in, or would be.
    variances : ndarray, shape (F,)
        Of a coordinate by all that was learnt, m²: mean square of what the frames of each fold are
        off by what was learnt without it, and more where the others stand as they never stood.
    """

    by_fold: NDArray[np.float64]
    by_all: NDArray[np.float64]
    fold: NDArray[np.int64]
    variances: NDArray[np.float64]


def learn_pattern(
    Z: NDArray[np.float64], y: NDArray[np.float64], is_known: NDArray[np.bool_], length: int
) -> Pattern:
    """Learn a marker's place from those of others, by ridge regression.

    The frames are cut into up to `MOST_FOLDS` runs no shorter than the gap, if two can be had; each
    is foretold by what was learnt from the others, and the ridge is that which foretells best. The
    pattern is of low rank, as that of [1]_: directions in which the others vary less than the ridge
    count for nothing.

    Parameters
    ----------
    Z : ndarray, shape (F, p)
        Places of the others in the body, metres, in order of time.
    y : ndarray, shape (F, D)
        Places of the marker, any where it is not known.
    is_known : ndarray of bool, shape (F,)
        Where it is.
    length : int
        Frames of the gap.

    References
    ----------
    .. [1] Gløersen & Federolf 2016, Predicting missing marker trajectories in human motion data
       using marker intercorrelations, PLoS ONE 11(3).
    """
    rows = np.flatnonzero(is_known)
    n, p = len(rows), Z.shape[1]
    n_folds = min(MOST_FOLDS, max(2, n // length))
    fold = np.searchsorted(rows, np.arange(len(Z))).clip(max=n - 1) * n_folds // n
    in_fold = fold[rows]
    begins = np.searchsorted(in_fold, np.arange(n_folds))
    # One column of ones learns the mean, without a ridge; all from the mean, for the digits' sake.
    mean_Z, mean_y = Z[rows].mean(axis=0), y[rows].mean(axis=0)
    A = np.concatenate([Z - mean_Z, np.ones((len(Z), 1))], axis=1)
    b = y[rows] - mean_y
    pieces = list(zip(np.split(A[rows], begins[1:]), np.split(b, begins[1:]), strict=True))
    G, g = (np.stack([a.T @ c for a, c in pairs]) for pairs in (
        [(a, a) for a, _ in pieces], pieces))  # fmt: skip
    # Of all but one fold, and of all.
    G = np.concatenate([G.sum(axis=0) - G, G.sum(axis=0)[None]])
    g = np.concatenate([g.sum(axis=0) - g, g.sum(axis=0)[None]])
    scale = max(np.trace(G[-1, :p, :p]) / p, 1e-12)  # one helper is at the very middle of its body
    each = np.append(np.full(p, scale), 1e-9)
    least, best, used = np.inf, g, RIDGES[-1]
    for ridge in RIDGES:
        B = np.linalg.solve(G + ridge * np.diag(each), g)
        off = np.concatenate([a @ B[f] - c for f, (a, c) in enumerate(pieces)])
        if (off**2).mean() < least:
            least, best, used = float((off**2).mean()), B, ridge
    found = A @ best + mean_y
    # Frames as near to each other as the gap is long tell the same: together they count for one.
    leverage = (A * np.linalg.solve(G[-1] + used * np.diag(each), A.T).T).sum(axis=1).clip(min=0)
    return Pattern(
        by_fold=found[:-1], by_all=found[-1], fold=fold, variances=least * (1 + length * leverage)
    )
