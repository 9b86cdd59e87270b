"""Points on their way through the sensing of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Points", "false_points", "in_unit_ball", "touching"]


class Points(NamedTuple):
    """Frame (N,), place (N, D) and marker (N,) of some points; marker -1 for false ones."""

    frames: NDArray[np.int64]
    places: NDArray[np.float64]
    markers: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> Points:
        """Return those that are chosen."""
        return Points(self.frames[chosen], self.places[chosen], self.markers[chosen])


def false_points(frames: NDArray[np.int64], places: NDArray[np.float64]) -> Points:
    """Return points that are of no marker."""
    return Points(frames, places, np.full(len(frames), -1))


def in_unit_ball(rng: np.random.Generator, n: int, n_axes: int) -> NDArray[np.float64]:
    """Draw `n` places evenly from the unit ball (the disc in 2-D), shape (n, n_axes)."""
    direction = rng.standard_normal((n, n_axes))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.random((n, 1)) ** (1 / n_axes)


def touching(
    places: NDArray[np.float64], cells: NDArray[np.int64], radii: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Group discs (balls) that touch, from neighbour to neighbour, within cells.

    Parameters
    ----------
    places : ndarray, shape (N, D)
        Their centres.
    cells : ndarray of int, shape (N,)
        Only discs of one cell can touch.
    radii : ndarray, shape (N,)
        Two touch whose centres are no farther apart than the sum of their radii.

    Returns
    -------
    ndarray of int, shape (N,)
        Group of each, from 0.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    n = len(places)
    reach = 2.0 * float(radii.max(initial=0.0))
    if not reach:
        return np.arange(n)
    # Cells far apart along an axis of their own, so that one tree does for all.
    tree: Any = KDTree(np.column_stack([places, cells * (2.0 * reach)]))
    pairs: NDArray[np.int64] = tree.query_pairs(reach, output_type="ndarray")
    apart = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    pairs = pairs[apart <= radii[pairs].sum(axis=1)]
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
