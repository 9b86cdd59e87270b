"""Points of a scene during its corruption."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Points", "false_points", "in_unit_ball", "touching"]


class Points(NamedTuple):
    """Points with frames and markers.

    Parameters
    ----------
    frames : ndarray of int, shape (N,)
        Frame of each point.
    places : ndarray of shape (N, D)
        Positions, metres.
    markers : ndarray of int, shape (N,)
        Marker of each point, -1 for a false point.
    """

    frames: NDArray[np.int64]
    places: NDArray[np.float64]
    markers: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> Points:
        """Return the chosen points.

        Parameters
        ----------
        chosen : ndarray of bool, shape (N,)
            True for the points to keep.

        Returns
        -------
        Points
        """
        return Points(self.frames[chosen], self.places[chosen], self.markers[chosen])


def false_points(frames: NDArray[np.int64], places: NDArray[np.float64]) -> Points:
    """Return points that belong to no marker.

    Parameters
    ----------
    frames, places
        As for `Points`.

    Returns
    -------
    Points
    """
    return Points(frames, places, np.full(len(frames), -1))


def in_unit_ball(rng: np.random.Generator, n: int, n_axes: int) -> NDArray[np.float64]:
    """Draw uniform positions in the unit ball (2-D: the disc).

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    n, n_axes : int
        Numbers of positions and of coordinates.

    Returns
    -------
    ndarray of shape (n, n_axes)
    """
    direction = rng.standard_normal((n, n_axes))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.random((n, 1)) ** (1 / n_axes)


def touching(
    places: NDArray[np.float64], cells: NDArray[np.int64], radii: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Group discs (3-D: balls) of a cell that touch directly or through others.

    Parameters
    ----------
    places : ndarray of shape (N, D)
        Centres of the discs.
    cells : ndarray of int, shape (N,)
        Cell of each disc; only discs of one cell can touch.
    radii : ndarray of shape (N,)
        Radii; two discs touch if the distance of their centres is at most the sum of their radii.

    Returns
    -------
    ndarray of int, shape (N,)
        Group of each disc, from 0.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    n = len(places)
    reach = 2.0 * float(radii.max(initial=0.0))
    if not reach:
        return np.arange(n)
    # Cells are far apart along a further axis, so that one tree serves all of them.
    tree: Any = KDTree(np.column_stack([places, cells * (2.0 * reach)]))
    pairs: NDArray[np.int64] = tree.query_pairs(reach, output_type="ndarray")
    apart = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    pairs = pairs[apart <= radii[pairs].sum(axis=1)]
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
