"""The marker set as measured on the subject of a capture, from the names found so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet
    from asterism.tracking.rigidity.distances import Distances

__all__ = ["Subject"]

NEIGHBOURS = 14
"""Number of neighbours of a marker by whose distances it is named."""
MIN_FRAMES = 8
"""Smallest number of common frames from which a distance is measured."""
PRIOR_FRAMES = 8
"""Number of frames that the marker set's movement of a distance counts as."""
UNKNOWN_MOVEMENT = 0.005, 0.1
"""Movement of a distance that the set does not know: metres, and share of the distance."""
KEPT, ATTACHED = (0.004, 0.01), (0.008, 0.05)
"""Error of a distance of the set on the same and on another subject: metres, and share."""
NOISE = 0.003
"""Error of a distance in a few frames, metres."""
LOOSE, MIN_WEIGHT = 0.015, 0.2
"""Movement, metres, at which a distance counts half as much, and the smallest weight: distances
of a loose pair vary together with those of their neighbours."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Subject:
    """The steadiest neighbours of each of M markers, as tables of shape (M, R)."""

    neighbours: NDArray[np.int64]
    distances: NDArray[np.float64]
    variances: NDArray[np.float64]
    weights: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        made: MarkerSet,
        size: float,
        found: Distances,
        *,
        is_kept: bool,
        markers: NDArray[np.int64] | None = None,
    ) -> Subject:
        """Measure a subject.

        Parameters
        ----------
        made : MarkerSet
            What is known beforehand; it fills in where the capture has too few frames.
        size : float
            Size of the subject relative to the set.
        found : Distances
            Distances from `markers` to all markers as named so far, of shape (n, M).
        is_kept : bool
            Whether the markers are where they were when the set was learnt.
        markers : ndarray of int, shape (n,), optional
            Markers whose rows are wanted; all by default.
        """
        own = np.arange(len(made)) if markers is None else markers
        before = size * made.distances[own]
        fixed, share = UNKNOWN_MOVEMENT
        movement = made.movements[own]
        movement = np.where(np.isfinite(movement), movement, fixed + share * before)
        fixed, share = KEPT if is_kept and made.knows_movement else ATTACHED
        error2 = (fixed + share * before) ** 2 + np.nan_to_num(made.variations[own]) ** 2
        is_known = (found.n_frames >= MIN_FRAMES) & np.isfinite(found.middle)
        n = np.minimum(found.n_frames, 60)
        pooled2 = (n * found.spread**2 + PRIOR_FRAMES * movement**2) / (n + PRIOR_FRAMES)
        variance = np.where(is_known, pooled2, movement**2 + error2)
        distance = np.where(is_known, found.middle, before)
        unused = own[:, None] == np.arange(len(made))
        unused |= ~np.isfinite(distance) | ~np.isfinite(variance)
        cost = np.where(unused, np.inf, np.sqrt(variance) + 0.02 * np.nan_to_num(distance))
        order = np.argsort(cost, axis=1, kind="stable")[:, :NEIGHBOURS]
        variance = np.where(unused, np.inf, variance)
        variance = np.take_along_axis(variance, order, axis=1)
        weight = MIN_WEIGHT + (1 - MIN_WEIGHT) / (1 + variance / LOOSE**2)
        return cls(
            neighbours=np.ascontiguousarray(order.astype(np.int64)),
            distances=np.nan_to_num(np.take_along_axis(distance, order, axis=1)),
            variances=variance + NOISE**2,
            weights=weight,
        )
