"""All numbers of the page in one deflated piece of text, as the player unpacks it.

The piece is, before it is deflated, the length of a JSON header (32 bits, little-endian), the
header, and the arrays that it lists, one after the other. Each array lies byte plane by byte plane:
all lowest bytes, then all next ones, which deflates far better than the numbers as they are.
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
"""Cells of the grid along each axis."""


class Grid(NamedTuple):
    """The grid on which positions are kept: 16 bits an axis.

    Attributes
    ----------
    low, step : ndarray, shape (3,)
        First cell and distance from cell to cell, metres.
    """

    low: NDArray[np.float64]
    step: NDArray[np.float64]

    def cells(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the cell of each point, shape (N, 3), and whether it is in the grid, (N,)."""
        cells = np.rint((points - self.low) / self.step)
        is_on = ((cells >= 0) & (cells <= STEPS)).all(axis=1)
        return np.clip(cells, 0, STEPS).astype(np.int64), np.asarray(is_on)


def grid_over(points: NDArray[np.float64], margin: float) -> Grid:
    """Lay the grid over points, shape (N, 3), and a margin of so many times their extent."""
    if not len(points):
        return Grid(np.zeros(3), np.full(3, 1e-6))
    low, high = points.min(axis=0), points.max(axis=0)
    room = margin * float((high - low).max())
    # Where nothing moves along an axis a cell of a micrometre is fine enough.
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
        Where sequences begin; rising.
    order : int
        1 predicts the cell before, 2 goes on as from the one before that.

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
        # A sequence of one has no second: that place begins the next.
        second = second[(second < len(cells)) & ~np.isin(second, begins)]
        rest[second] = first[second]
    wrapped = (rest + 2**15) % 2**16 - 2**15
    return ((wrapped << 1) ^ (wrapped >> 15)).astype(np.uint16)


def packed(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Pack a header and arrays.

    Parameters
    ----------
    header : mapping
        What JSON can hold.
    arrays : mapping
        By name; their element types are kept.

    Returns
    -------
    str
        Base64, safe in any HTML.
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
