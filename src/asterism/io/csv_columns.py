"""Parsing of the columns of a CSV with a header, with the line of any error."""

from __future__ import annotations

import csv
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError
from asterism.io.units import PER_METRE

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["SOURCE_UNIT", "columns_of", "quoted", "source_unit", "whole"]

SOURCE_UNIT = "source_unit"
"""Column of the unit of a capture's source file; the coordinates are metres."""

_CHUNK = 4096  # lines at a time, so that the cells as texts never fill the memory
_TO_QUOTE = frozenset(',"\r\n')


def columns_of(
    path: Path, lines: Sequence[str], header: Sequence[str], texts: Collection[str]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, list[str]]]:
    """Parse the columns of a CSV.

    Parameters
    ----------
    path : Path
        File for messages.
    lines : sequence of str
        All lines, the header first.
    header : sequence of str
        Names of the columns, all different.
    texts : collection of str
        Columns that hold text; the others hold finite numbers or nothing.

    Returns
    -------
    numbers : dict of ndarray of shape (rows,)
        Numbers by the name of their column; NaN for a blank cell.
    texts : dict of list of str
        Texts by the name of their column, not stripped.

    Raises
    ------
    FormatError
        If a cell is malformed; the error names its line and column.
    """
    parts: dict[str, list[NDArray[np.float64]]] = {c: [] for c in header if c not in texts}
    words: dict[str, list[str]] = {c: [] for c in header if c in texts}
    width = len(header)
    for begin in range(1, len(lines), _CHUNK):
        chunk = lines[begin : begin + _CHUNK]
        if any('"' in line for line in chunk):
            rows = [_split(path, line, begin + i + 1) for i, line in enumerate(chunk)]
            widths = [len(row) for row in rows]
            cells = list(chain.from_iterable(rows))
        else:  # many times faster
            widths = [line.count(",") + 1 for line in chunk]
            cells = ",".join(chunk).split(",")
        wrong = next((i for i, n in enumerate(widths) if n != width), None)
        if wrong is not None:
            place = f"line {begin + wrong + 1}"
            raise FormatError(path, place, f"{width} columns", widths[wrong])
        for i, column in enumerate(header):
            if column in texts:
                words[column] += cells[i::width]
            else:
                parts[column].append(_numbers(path, column, cells[i::width], begin + 1))
    return {c: np.concatenate(p) if p else np.empty(0) for c, p in parts.items()}, words


def whole(
    path: Path, column: str, values: NDArray[np.float64], lines: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Convert whole numbers to integers.

    Parameters
    ----------
    path : Path
        File for messages.
    column : str
        Column for messages.
    values : ndarray of shape (n,)
        Whole numbers as floats.
    lines : ndarray of int, shape (n,)
        Line of each number for messages.

    Returns
    -------
    ndarray of int, shape (n,)
        The same numbers.

    Raises
    ------
    FormatError
        If a number is not whole, or is larger than 2**53.
    """
    bad = np.flatnonzero((values != np.floor(values)) | (np.abs(values) > 2**53))
    if len(bad):
        place = f"line {lines[bad[0]]}, column {column}"
        raise FormatError(path, place, "a whole number", f"{values[bad[0]]:g}")
    return values.astype(np.int64)


def source_unit(path: Path, texts: Sequence[str]) -> str:
    """Return the unit of the cells of a column, "m" if all are blank.

    Parameters
    ----------
    path : Path
        File for messages.
    texts : sequence of str
        Cells of the column, from line 2; some may be blank.

    Returns
    -------
    str
        Key of `PER_METRE`.

    Raises
    ------
    FormatError
        If a cell is not a unit, or two differ.
    """
    found = dict.fromkeys(texts)
    found.pop("", None)
    for i, text in enumerate(found):
        place = f"line {texts.index(text) + 2}, column {SOURCE_UNIT}"
        if text not in PER_METRE:
            raise FormatError(path, place, f"one of {', '.join(PER_METRE)}", repr(text)[:60])
        if i:
            raise FormatError(path, place, f"{next(iter(found))!r}, as above", repr(text))
    return next(iter(found), "m")


def quoted(text: str) -> str:
    """Return a text as a CSV cell, in quotes if necessary."""
    if _TO_QUOTE.isdisjoint(text):
        return text
    return '"' + text.replace('"', '""') + '"'


def _split(path: Path, line: str, number: int) -> list[str]:
    try:
        return next(csv.reader([line], strict=True), [])
    except csv.Error as error:
        raise FormatError(path, f"line {number}", "CSV", str(error)) from error


def _numbers(path: Path, column: str, cells: list[str], line: int) -> NDArray[np.float64]:
    try:
        values = np.array([cell or "nan" for cell in cells], dtype=np.float64)
    except ValueError:
        values = np.array([_number_or_inf(cell) for cell in cells])
    bad = np.flatnonzero(np.isinf(values))
    if len(bad):
        place = f"line {line + bad[0]}, column {column}"
        raise FormatError(path, place, "a finite number or nothing", repr(cells[bad[0]]))
    return values


def _number_or_inf(cell: str) -> float:
    try:
        return float(cell.strip() or "nan")
    except ValueError:
        return np.inf
