"""Lost markers found by their distances, written out in NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BONDS, FREE = 5, 4
UNKNOWN, ENOUGH, LEAD = 1 / 3, 6.0, 3.0


def log_t(off: Array, spread: Array) -> Array:
    """Return the log density of Student's t with three degrees of freedom, but for a constant."""
    return -2 * np.log1p((off / spread) ** 2 / 3) - np.log(spread)


def log_odds(points: Array, at: Array, distances: Array, spreads: Array) -> Array:
    """Return the log odds of points (n, D) being of a track, by its distances to others (K, D)."""
    used = np.argsort(spreads, kind="stable")
    used = used[np.isfinite(spreads[used]) & np.isfinite(at[used]).all(axis=1)][:BONDS]
    if not len(used):
        return np.full(len(points), -np.inf)
    d, s = distances[used], spreads[used]
    off = np.linalg.norm(points[:, None] - at[used], axis=2) - d
    return (log_t(off, s) - log_t(off, np.hypot(s, UNKNOWN * d))).mean(axis=1) * min(
        len(used), FREE
    )


def found_in_frame(
    points: Array, labels: NDArray[np.int64], distances: Array, spreads: Array
) -> NDArray[np.int64]:
    """Return the labels of a frame, with those of lost markers; all odds anew in each step."""
    labels, n_tracks = labels.copy(), len(distances)
    while True:
        at = np.full((n_tracks, points.shape[1]), np.nan)
        at[labels[labels >= 0]] = points[labels >= 0]
        odds = np.full((n_tracks, len(points)), -np.inf)
        for k in np.setdiff1d(np.arange(n_tracks), labels):
            odds[k] = log_odds(points, at, distances[k], spreads[k])
        odds[:, labels >= 0] = -np.inf
        for k, i in zip(*np.unravel_index(np.argsort(-odds, axis=None), odds.shape), strict=True):
            rivals = np.concatenate([np.delete(odds[k], i), np.delete(odds[:, i], k)])
            if odds[k, i] >= ENOUGH and odds[k, i] - rivals.max(initial=-np.inf) >= LEAD:
                labels[i] = k
                break
        else:
            return labels
