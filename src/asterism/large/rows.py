"""Rows of a plain table: chunks as they are read, frames as they are tracked.

A row is kept in the form of its file (a line of text, a part of an Arrow table), so every column of
the input appears unchanged in the output.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from asterism.errors import FormatError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.large.columns import Layout

__all__ = ["Chunk", "Table", "TableFrame", "Writer", "frames_of"]


@record(eq=False)
class Chunk:
    """Some rows of a table.

    Attributes
    ----------
    keys : ndarray of shape (n,)
        Frame number or, without one, time of each row.
    times : ndarray of shape (n,)
        Time of each row, seconds.
    points : ndarray of shape (n, D)
        Positions, metres.
    rows : sequence of n rows
        The rows in the form of the file; it can be sliced.

    Examples
    --------
    >>> Chunk(keys=np.zeros(2), times=np.zeros(2), points=np.ones((2, 3)), rows=["a", "b"]).keys
    array([0., 0.])
    """

    keys: NDArray[np.float64]
    times: NDArray[np.float64]
    points: NDArray[np.float64]
    rows: Any

    @classmethod
    def of(
        cls, path: Path, layout: Layout, values: NDArray[np.float64], rows: Any,
        *, place: Callable[[int], str],
    ) -> Chunk:  # fmt: skip
        """Check the numbers of some rows.

        Parameters
        ----------
        path : Path
            File for messages.
        layout : Layout
            Columns of the table.
        values : ndarray of shape (n, columns)
            Values of ``layout.numbers``.
        rows : sequence of n rows
            The rows in the form of the file.
        place : callable
            Returns the place of a row, counted from 0, for messages.

        Raises
        ------
        FormatError
            If a number is not finite, or a frame number is not whole.
        """
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            row, column = bad[0]
            at = f"{place(int(row))}, column {layout.numbers[column]}"
            hint = "leave out rows without a position"
            raise FormatError(path, at, "a finite number", f"{values[row, column]:g}", hint)
        n = len(layout.numbers) - len(layout.axes)
        keys = values[:, 0]
        if layout.frame is not None:
            bad = np.flatnonzero((keys != np.floor(keys)) | (np.abs(keys) > 2**53))
            if len(bad):
                at = f"{place(int(bad[0]))}, column {layout.frame}"
                raise FormatError(path, at, "a whole number", f"{keys[bad[0]]:g}")
        times = values[:, n - 1] if layout.time is not None else keys / layout.rate
        points = np.ascontiguousarray(values[:, n:]) / layout.per_metre
        back = np.flatnonzero(np.diff(keys) < 0)
        if len(back):
            k = int(back[0])
            raise _unordered(path, place(k + 1), float(keys[k + 1]), float(keys[k]))
        return cls(keys=keys, times=times, points=points, rows=rows)


@record(eq=False)
class TableFrame:
    """All rows of one frame.

    Attributes
    ----------
    key : float
        Frame number or, without one, time.
    time : float
        Time, seconds.
    points : ndarray of shape (N, D)
        Detections, metres.
    rows : list
        Parts of the table, together N rows.

    Examples
    --------
    >>> TableFrame(key=0.0, time=0.0, points=np.zeros((2, 3)), rows=[["a", "b"]])
    TableFrame(key=0, time=0, points=array (2, 3), rows=[['a', 'b']])
    """

    key: float
    time: float
    points: NDArray[np.float64]
    rows: list[Any]


class Writer(Protocol):
    """Writes the rows of frames with their labels.

    Examples
    --------
    >>> Writer.__name__
    'Writer'
    """

    def write(self, rows: list[Any], labels: NDArray[np.int64]) -> None:
        """Write the rows of a frame with a label for each."""
        ...


class Table(Protocol):
    """Table that is read a part at a time.

    Examples
    --------
    >>> Table.__name__
    'Table'
    """

    @property
    def path(self) -> Path:
        """File."""
        ...

    @property
    def layout(self) -> Layout:
        """Columns."""
        ...

    def chunks(self) -> Iterator[Chunk]:
        """Yield the rows in order, some at a time."""
        ...

    def writing(self, out: Path) -> AbstractContextManager[Writer]:
        """Open a table for the same rows with labels; the file appears when the block ends."""
        ...


def frames_of(path: Path, chunks: Iterable[Chunk]) -> Iterator[TableFrame]:
    """Yield the frames of a table whose rows stand in the order of frames.

    Parameters
    ----------
    path : Path
        File for messages.
    chunks : iterable of Chunk
        Rows in order. A frame may extend over several chunks.

    Yields
    ------
    TableFrame

    Raises
    ------
    FormatError
        If frames or times do not increase, or a frame has two times.

    Examples
    --------
    >>> from pathlib import Path
    >>> keys = np.array([0.0, 0.0, 1.0])
    >>> chunk = Chunk(keys=keys, times=keys, points=np.ones((3, 2)), rows=["a", "b", "c"])
    >>> [frame.rows for frame in frames_of(Path("t.csv"), [chunk])]
    [[['a', 'b']], [['c']]]
    """
    parts: list[Chunk] = []
    last = -np.inf
    for chunk in chunks:
        if not len(chunk.keys):
            continue
        starts = np.flatnonzero(np.diff(chunk.keys, prepend=np.nan) != 0)
        for start, end in zip(starts, [*starts[1:], len(chunk.keys)], strict=True):
            part = Chunk(
                keys=chunk.keys[start:end], times=chunk.times[start:end],
                points=chunk.points[start:end], rows=chunk.rows[start:end],
            )  # fmt: skip
            if parts and part.keys[0] != parts[0].keys[0]:
                if part.keys[0] < parts[0].keys[0]:
                    now, before = float(part.keys[0]), float(parts[0].keys[0])
                    raise _unordered(path, _frame(now), now, before)
                frame = _joined(path, parts, last)
                last, parts = frame.time, []
                yield frame
            parts.append(part)
    if parts:
        yield _joined(path, parts, last)


def _joined(path: Path, parts: list[Chunk], last: float) -> TableFrame:
    times = np.concatenate([part.times for part in parts])
    key, time = float(parts[0].keys[0]), float(times[0])
    if (times != time).any():
        other = times[times != time][0]
        raise FormatError(path, _frame(key), f"the time {time:g} in every row", f"{other:g}")
    if time <= last:
        expected, hint = f"a time after {last:g} s", "sort the table by time"
        raise FormatError(path, _frame(key), expected, f"{time:g} s", hint)
    points = np.concatenate([part.points for part in parts])
    return TableFrame(key=key, time=time, points=points, rows=[part.rows for part in parts])


def _frame(key: float) -> str:
    return f"frame {key:.12g}"


def _unordered(path: Path, place: str, found: float, before: float) -> FormatError:
    expected, hint = f"a frame or time ≥ {before:.12g}", "sort the table by frame or time"
    return FormatError(path, place, expected, f"{found:.12g}", hint)
