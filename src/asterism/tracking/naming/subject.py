"""The marker set as measured on the subject of a capture, from the names found so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet
    from asterism.tracking.rigidity.distances import Distances

__all__ = ["Subject"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Subject:
    """The steadiest neighbours of each of M markers, as tables of shape (M, R).

    Distances are in metres; an infinite variance is unused. The engine measures them
    (`engine/naming/measured_neighbours.hpp`).
    """

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
        neighbours, distances, variances, weights = _engine.measured_neighbours(
            np.arange(len(made)) if markers is None else markers,
            size=size,
            is_kept=is_kept and made.knows_movement,
            distances=made.distances,
            movements=made.movements,
            variations=made.variations,
            middle=found.middle,
            spread=found.spread,
            n_frames=found.n_frames.astype(np.float64),
        )
        return cls(neighbours=neighbours, distances=distances, variances=variances, weights=weights)
