"""Points on their way through the sensing of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Points", "false_points", "in_unit_ball"]


class Points(NamedTuple):
    """Frame (N,), place (N, D) and marker (N,) of some points; marker -1 for false ones."""

    frames: NDArray[np.int64]
    places: NDArray[np.float64]
    markers: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> Points:
        """Give those that are chosen."""
        return Points(self.frames[chosen], self.places[chosen], self.markers[chosen])


def false_points(frames: NDArray[np.int64], places: NDArray[np.float64]) -> Points:
    """Give points that are of no marker."""
    return Points(frames, places, np.full(len(frames), -1))


def in_unit_ball(rng: np.random.Generator, n: int, n_axes: int) -> NDArray[np.float64]:
    """Draw `n` places evenly from the unit ball (the disc in 2-D), shape (n, n_axes)."""
    direction = rng.standard_normal((n, n_axes))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.random((n, 1)) ** (1 / n_axes)
