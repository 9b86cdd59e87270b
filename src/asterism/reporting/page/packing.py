"""Packing of all numbers of the page into one deflated text, which the player unpacks.

Before compression the data are the length of a JSON header (32 bits, little-endian), the header,
and the arrays that it lists. Each array is stored by byte planes: all lowest bytes, then all next
ones, which deflates far better than whole numbers.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["Grid", "grid_over", "packed", "residuals"]

STEPS = 2**16 - 1
"""Number of cells of the grid along each axis."""


class Grid(NamedTuple):
    """Grid of positions, with 16 bits per axis.

    Attributes
    ----------
    low, step : ndarray of shape (3,)
        Position of the first cell, and spacing of the cells, metres.
    """

    low: NDArray[np.float64]
    step: NDArray[np.float64]

    def cells(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the cell of each point, shape (N, 3), and whether it is inside, shape (N,)."""
        cells = np.rint((points - self.low) / self.step)
        is_on = ((cells >= 0) & (cells <= STEPS)).all(axis=1)
        return np.clip(cells, 0, STEPS).astype(np.int64), np.asarray(is_on)


def grid_over(points: NDArray[np.float64], margin: float) -> Grid:
    """Return a grid over points, shape (N, 3), with a margin relative to their extent."""
    if not len(points):
        return Grid(np.zeros(3), np.full(3, 1e-6))
    low, high = points.min(axis=0), points.max(axis=0)
    room = margin * float((high - low).max())
    # Without any extent along an axis, a cell of a micrometre is small enough.
    return Grid(low - room, np.maximum((high - low + 2 * room) / STEPS, 1e-6))


def residuals(
    cells: NDArray[np.int64], begins: NDArray[np.int64], order: int
) -> NDArray[np.uint16]:
    """Return the residuals of cells after prediction from earlier ones, zigzag encoded.

    Parameters
    ----------
    cells : ndarray of int, shape (N,)
        Cells along one axis, sequence after sequence.
    begins : ndarray of int, shape (S,)
        First index of each sequence, increasing.
    order : int
        Order of the prediction: 1 for the previous cell, 2 for linear extrapolation.

    Returns
    -------
    ndarray of uint16, shape (N,)
        Differences modulo 2¹⁶; even for 0, 1, 2 …, odd for -1, -2 …
    """
    first = np.diff(cells, prepend=0)
    first[begins] = cells[begins]
    rest = first
    if order == 2:
        rest = np.diff(first, prepend=0)
        rest[begins] = cells[begins]
        second = begins + 1
        # A sequence of one has no second element; that index is the start of the next sequence.
        second = second[(second < len(cells)) & ~np.isin(second, begins)]
        rest[second] = first[second]
    wrapped = (rest + 2**15) % 2**16 - 2**15
    return ((wrapped << 1) ^ (wrapped >> 15)).astype(np.uint16)


def packed(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Pack a header and arrays.

    Parameters
    ----------
    header : mapping
        Header, of types that JSON can hold.
    arrays : mapping
        Arrays by name; their element types are kept.

    Returns
    -------
    str
        Data in Base64, which needs no escaping in HTML.
    """
    kinds = {name: [array.dtype.name, array.size] for name, array in arrays.items()}
    text = json.dumps({**header, "arrays": kinds}, ensure_ascii=True, allow_nan=False).encode()
    planes = [_planes(array) for array in arrays.values()]
    content = b"".join([len(text).to_bytes(4, "little"), text, *planes])
    return base64.b64encode(zlib.compress(content, 6)).decode()


def _planes(array: NDArray[Any]) -> bytes:
    flat = np.ascontiguousarray(array).ravel()
    little = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    return little.view(np.uint8).reshape(len(flat), flat.itemsize).T.tobytes()
