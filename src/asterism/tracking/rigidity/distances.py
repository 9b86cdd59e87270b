"""How far markers are from each other over a take, and how steadily."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Distances", "distances_between", "distances_from"]


@record(eq=False)
class Distances:
    """Distances over some frames.

    Parameters
    ----------
    middle : ndarray, shape (..., n)
        Their medians, metres; NaN where two were never seen together.
    spread : ndarray, shape (..., n)
        Half the middle 68 %, which is the standard deviation where they are Gaussian, metres.
    n_frames : ndarray of int, shape (..., n)
        Frames in which both were seen.
    """

    middle: NDArray[np.float64]
    spread: NDArray[np.float64]
    n_frames: NDArray[np.int64]


def distances_from(marker: NDArray[np.float64], others: NDArray[np.float64]) -> Distances:
    """Measure from one marker to others.

    Parameters
    ----------
    marker : ndarray, shape (F, D)
        Positions, NaN where not seen.
    others : ndarray, shape (F, n, D)

    Returns
    -------
    Distances
        Of shape (n,).
    """
    distance = np.sqrt(((others - marker[:, None]) ** 2).sum(axis=2))
    n = np.isfinite(distance).sum(axis=0)
    ordered = np.sort(distance, axis=0)  # NaN goes last
    low, middle, high = (
        ordered[np.minimum((share * n).astype(int), len(ordered) - 1), np.arange(len(n))]
        for share in (0.16, 0.5, 0.84)
    )
    return Distances(middle=middle, spread=(high - low) / 2, n_frames=n)


def distances_between(positions: NDArray[np.float64]) -> Distances:
    """Measure between all markers of a take.

    Parameters
    ----------
    positions : ndarray, shape (F, K, D)
        NaN where not seen.

    Returns
    -------
    Distances
        Of shape (K, K).
    """
    F, K, _ = positions.shape
    if F == 0 or K == 0:
        none = np.full((K, K), np.nan)
        return Distances(middle=none, spread=none, n_frames=np.zeros((K, K), dtype=np.int64))
    rows = [distances_from(positions[:, k], positions) for k in range(K)]
    return Distances(
        middle=np.stack([row.middle for row in rows]),
        spread=np.stack([row.spread for row in rows]),
        n_frames=np.stack([row.n_frames for row in rows]),
    )
