"""Cutting of a frame into spatial tiles with overlap.

Every track belongs to the tile in which its predicted position lies. A tile has all detections that
one of its tracks can reach, so neighbouring tiles overlap by the radii of their gates. How the
scene is cut changes the time of a frame and not its result: a group of tracks and detections that
more than one tile can reach is joined and solved as a whole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Tile", "cut", "tile_side"]

TRACKS_A_TILE = 25_000
"""Mean number of detections of a tile, if its side is not given."""
_MAX_CELL = 2**20  # cells beyond it belong to the outermost tile


@record(eq=False)
class Tile:
    """Tracks and detections of one tile.

    Attributes
    ----------
    tracks : ndarray of int64, shape (k,)
        Indices of its tracks in the frame, increasing.
    points : tuple of ndarray of int64, each of shape (m,)
        For each frame, the indices of the detections that one of them can reach, increasing.

    Examples
    --------
    >>> Tile(tracks=np.array([0, 2]), points=(np.array([1]),)).tracks
    array([0, 2])
    """

    tracks: NDArray[np.int64]
    points: tuple[NDArray[np.int64], ...]


def tile_side(points: NDArray[np.float64]) -> float:
    """Return the side of tiles that have `TRACKS_A_TILE` detections of a frame each, metres.

    Parameters
    ----------
    points : ndarray of shape (N, D)
        Detections of a frame, metres.

    Returns
    -------
    float
        Side, infinite if one tile is enough.

    Examples
    --------
    >>> tile_side(np.zeros((10, 3)))
    inf
    """
    n_tiles = len(points) / TRACKS_A_TILE
    if n_tiles <= 1:
        return np.inf
    extent = np.ptp(points, axis=0)
    volume = float(np.prod(extent[extent > 0]))
    n_axes = int((extent > 0).sum())
    return (volume / n_tiles) ** (1 / n_axes) if n_axes else np.inf


def cut(
    regions: NDArray[np.float64], frames: Sequence[NDArray[np.float64]], side: float
) -> list[Tile]:
    """Cut a frame, and the frames of its look-ahead, into cubic tiles.

    Parameters
    ----------
    regions : ndarray of shape (K, W, D + 1)
        For each track and frame, the predicted position and the distance from it within which the
        track can be assigned a detection, metres; negative if there is none.
    frames : sequence of ndarray, each of shape (N, D)
        Detections of the W frames, metres.
    side : float
        Side of a tile, metres, > 0. At infinity there is one tile.

    Returns
    -------
    list of Tile
        Tiles with at least one track, in the order of their cells.

    Examples
    --------
    >>> regions = np.array([[[0.1, 0, 0.5]], [[3, 0, 0.5]]])
    >>> [tile.points[0].tolist() for tile in cut(regions, [[[0.2, 0], [3.1, 0], [9, 9]]], side=1.0)]
    [[0], [1]]
    """
    if not len(regions):
        return []
    centers, reach = regions[..., :-1], np.maximum(regions[..., -1:], 0.0)
    groups = [np.arange(len(centers))]
    if np.isfinite(side):
        cells = np.floor(centers[:, 0] / side)
        cells = np.clip(cells, -_MAX_CELL, _MAX_CELL).astype(np.int64)
        order = np.lexsort(cells.T[::-1])  # stable, so the tracks of a cell stay increasing
        is_new = (np.diff(cells[order], axis=0) != 0).any(axis=1)
        groups = np.split(order, np.flatnonzero(is_new) + 1)
    together = np.concatenate(groups)
    begins = np.cumsum([0, *map(len, groups[:-1])])
    lows = np.minimum.reduceat((centers - reach)[together], begins)
    highs = np.maximum.reduceat((centers + reach)[together], begins)
    inside = [
        _in_boxes(np.asarray(points), list(zip(lows[:, f], highs[:, f], strict=True)))
        for f, points in enumerate(frames)
    ]
    return [
        Tile(tracks=tracks, points=tuple(frame[t] for frame in inside))
        for t, tracks in enumerate(groups)
    ]


def _in_boxes(
    points: NDArray[np.float64], boxes: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> list[NDArray[np.int64]]:
    """Return the indices of the points in each box from one corner to the other, increasing."""
    along = np.argsort(points[:, 0], kind="stable")
    columns = [points[along, d] for d in range(points.shape[1])]  # each contiguous
    found: list[NDArray[np.int64]] = []
    for start, end in boxes:
        first = np.searchsorted(columns[0], start[0], "left")
        last = np.searchsorted(columns[0], end[0], "right")
        is_inside = np.ones(max(last - first, 0), dtype=bool)
        for d in range(1, len(columns)):
            values = columns[d][first:last]
            is_inside &= (values >= start[d]) & (values <= end[d])
        found.append(np.sort(along[first:last][is_inside]))
    return found
