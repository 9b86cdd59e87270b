"""Prediction of a marker from other markers by ridge regression in body coordinates.

Symbols: F frames, p features Z, y the marker's position, D axes, G = ZᵀZ, g = Zᵀy, B the weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Pattern", "learn_pattern"]

MAX_FOLDS = 8
RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Strengths of the ridge that are tried, in mean variances of a feature."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pattern:
    """Predictions of a marker's position from other markers.

    Parameters
    ----------
    by_fold : ndarray of shape (folds, F, D)
        Positions predicted by the regression without each fold.
    by_all : ndarray of shape (F, D)
        Positions predicted by the regression over all folds.
    fold : ndarray of int, shape (F,)
        Fold to which each frame belongs, or is nearest.
    variances : ndarray of shape (F,)
        Variance of a coordinate, m²: the mean square error of each fold predicted without it,
        inflated for poses far from those of the frames used in the regression.
    """

    by_fold: NDArray[np.float64]
    by_all: NDArray[np.float64]
    fold: NDArray[np.int64]
    variances: NDArray[np.float64]


def learn_pattern(
    Z: NDArray[np.float64], y: NDArray[np.float64], is_known: NDArray[np.bool_], length: int
) -> Pattern:
    """Estimate the regression of a marker's position on other markers, with a ridge.

    The frames are cut into up to `MAX_FOLDS` folds no shorter than the gap, if there are two of
    them. Each fold is predicted from the others, and the ridge with the smallest error is used.
    The pattern has a low rank, as in [1]: directions with less variance than the ridge have no
    effect.

    Parameters
    ----------
    Z : ndarray of shape (F, p)
        Positions of the other markers in body coordinates, metres, in order of time.
    y : ndarray of shape (F, D)
        Positions of the marker, metres; any values where it is not known.
    is_known : ndarray of bool, shape (F,)
        True where the marker is known.
    length : int
        Number of frames of the gap.

    Returns
    -------
    Pattern

    References
    ----------
    1. Gløersen & Federolf 2016, Predicting missing marker trajectories in human motion data
       using marker intercorrelations, PLoS ONE 11(3).
    """
    rows = np.flatnonzero(is_known)
    n, p = len(rows), Z.shape[1]
    n_folds = min(MAX_FOLDS, max(2, n // length))
    fold = np.searchsorted(rows, np.arange(len(Z))).clip(max=n - 1) * n_folds // n
    in_fold = fold[rows]
    begins = np.searchsorted(in_fold, np.arange(n_folds))
    # A column of ones without a ridge represents the mean. Features are centred for numerical
    # accuracy.
    mean_Z, mean_y = Z[rows].mean(axis=0), y[rows].mean(axis=0)
    A = np.concatenate([Z - mean_Z, np.ones((len(Z), 1))], axis=1)
    b = y[rows] - mean_y
    pieces = list(zip(np.split(A[rows], begins[1:]), np.split(b, begins[1:]), strict=True))
    G, g = (np.stack([a.T @ c for a, c in pairs]) for pairs in (
        [(a, a) for a, _ in pieces], pieces))  # fmt: skip
    # Sums over all but one fold, and over all folds.
    G = np.concatenate([G.sum(axis=0) - G, G.sum(axis=0)[None]])
    g = np.concatenate([g.sum(axis=0) - g, g.sum(axis=0)[None]])
    scale = max(np.trace(G[-1, :p, :p]) / p, 1e-12)  # a single helper is the centre of its body
    each = np.append(np.full(p, scale), 1e-9)
    ridges = np.array(RIDGES)[:, None, None, None] * np.diag(each)
    B = np.linalg.solve(G + ridges, np.broadcast_to(g, (len(RIDGES), *g.shape)))
    missed = np.concatenate([a @ B[:, f] - c for f, (a, c) in enumerate(pieces)], axis=1)
    squares = (missed**2).sum(axis=(1, 2))
    used = int(np.argmin(squares))
    least = float(squares[used]) / b.size
    found = A @ B[used] + mean_y
    # Frames within the length of a gap are correlated: together they count as one sample.
    leverage = (A * np.linalg.solve(G[-1] + ridges[used, 0], A.T).T).sum(axis=1).clip(min=0)
    return Pattern(
        by_fold=found[:-1], by_all=found[-1], fold=fold, variances=least * (1 + length * leverage)
    )
