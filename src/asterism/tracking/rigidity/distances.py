"""Distances between markers over a capture, with the engine's criterion for bonds.

For a stream the engine keeps a running mean and variance of each distance. For a whole capture the
median and the central 68 % are used instead: they are robust against a track that holds another
marker for a while. The criterion itself is the engine's (`engine/rigid/bond.hpp`).
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
"""Share of a distance by which a body may still bend if it did not bend so far."""
MIN_TOGETHER = _engine.MIN_TOGETHER
"""Smallest number of frames in which both markers of a pair are detected."""


@record(eq=False)
class Distances:
    """Statistics of distances over some frames.

    Parameters
    ----------
    middle : ndarray of shape (..., n)
        Median distances, metres; NaN for two markers without a common frame.
    spread : ndarray of shape (..., n)
        Half the width of the central 68 %, metres: the standard deviation of a Gaussian.
    n_frames : ndarray of int, shape (..., n)
        Number of frames in which both markers were detected.
    """

    middle: NDArray[np.float64]
    spread: NDArray[np.float64]
    n_frames: NDArray[np.int64]

    @property
    def predictive_variance(self) -> NDArray[np.float64]:
        """Predictive variance of each distance in the next frame, m²."""
        return self._judged()[0]

    @property
    def is_bond(self) -> NDArray[np.bool_]:
        """True for distances with enough frames that are known to a tenth of their length."""
        return self._judged()[1]

    def _judged(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        variance, is_bond = _engine.judge_distances(
            self.middle.ravel(), (self.spread**2).ravel(), self.n_frames.ravel()
        )
        return variance.reshape(self.middle.shape), is_bond.reshape(self.middle.shape)


def distances_from(marker: NDArray[np.float64], others: NDArray[np.float64]) -> Distances:
    """Measure the distances from one marker to others.

    Parameters
    ----------
    marker : ndarray of shape (F, D)
        Positions, metres, NaN where not detected.
    others : ndarray of shape (F, n, D)
        Positions of the other markers.

    Returns
    -------
    Distances
        Of shape (n,).
    """
    distance = np.sqrt(((others - marker[:, None]) ** 2).sum(axis=2))
    n = np.isfinite(distance).sum(axis=0)
    ordered = np.sort(distance, axis=0)  # NaN is sorted last
    low, middle, high = (
        ordered[np.minimum((share * n).astype(int), len(ordered) - 1), np.arange(len(n))]
        for share in (0.16, 0.5, 0.84)
    )
    return Distances(middle=middle, spread=(high - low) / 2, n_frames=n)


def distances_between(positions: NDArray[np.float64]) -> Distances:
    """Measure the distances between all markers of a capture.

    Parameters
    ----------
    positions : ndarray of shape (F, K, D)
        Positions, metres, NaN where not detected.

    Returns
    -------
    Distances
        Of shape (K, K).
    """
    middle, spread, n_frames = _engine.distances_between(np.ascontiguousarray(positions))
    return Distances(middle=middle, spread=spread, n_frames=n_frames)
