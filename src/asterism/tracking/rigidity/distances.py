"""Distances between markers over a capture, judged as the engine judges those of a stream.

The engine keeps a running mean and variance of each distance. Here all frames are there at once,
and the median and the middle 68 % stand in their place: a track that holds another marker for a
while would spoil a mean, and with means fewer markers are named right. Everything after that is
the engine's (`engine/rigid/bond.hpp`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BEND", "MIN_TOGETHER", "Distances", "distances_between", "distances_from"]

BEND = _engine.BEND
"""Share of a distance by which a body may bend that was not seen to bend."""
MIN_TOGETHER = _engine.MIN_TOGETHER
"""Frames in which two markers must have been seen together."""


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

    @property
    def predictive_variance(self) -> NDArray[np.float64]:
        """Variance of each distance when it is measured next, m²."""
        return self._judged()[0]

    @property
    def is_bond(self) -> NDArray[np.bool_]:
        """Whether each distance was seen for long enough and is known to a tenth of itself."""
        return self._judged()[1]

    def _judged(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        variance, is_bond = _engine.judge_distances(
            self.middle.ravel(), (self.spread**2).ravel(), self.n_frames.ravel()
        )
        return variance.reshape(self.middle.shape), is_bond.reshape(self.middle.shape)


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
