"""Parsing of tables of numbers in text, shared by TRC, TSV and the CSVs."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["as_utf8", "cells_of", "check_times", "parse_rows", "plain", "read_lines"]  # fmt: skip

_CHUNK = 4096  # rows at a time, so that the fields as texts never fill the memory
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_GAPS = {"", "null", "nan", "none"}


def as_utf8(head: bytes) -> bytes:
    """Convert the first bytes of a file to UTF-8 if they begin with the mark of UTF-16."""
    return head.decode("utf-16", "ignore").encode() if head[:2] in _UTF16 else head


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file in UTF-8, in marked UTF-16, or else in Latin-1."""
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-16" if raw[:2] in _UTF16 else "utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def cells_of(line: str) -> list[str]:
    """Return the stripped cells of one line of CSV; an empty list if it is not CSV."""
    try:
        return [cell.strip() for cell in next(csv.reader([line.strip("\r\n")]), [])]
    except csv.Error:
        return []


def parse_rows(
    path: Path, lines: list[str], first: int, n_columns: int, separator: str
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Parse lines of numbers.

    Parameters
    ----------
    path : Path
        File for messages.
    lines : list of str
        All lines of the file.
    first : int
        Index of the first data line; blank lines are skipped.
    n_columns : int
        Numbers per line. Further fields must be blank; fewer are an error.
    separator : str
        Separator of the fields.

    Returns
    -------
    values : ndarray of shape (R, n_columns)
        NaN for a blank field, NULL or NaN.
    numbers : ndarray of int, shape (R,)
        Line number of each row, from 1.
    """
    numbers = np.array(
        [i + 1 for i in range(first, len(lines)) if lines[i].strip(separator + " ")], dtype=np.int64
    )
    # Checked before anything is allocated: the header of a malicious file may claim any width.
    if len(numbers) and lines[numbers[0] - 1].count(separator) + 1 < n_columns:
        _complain(path, lines[numbers[0] - 1], int(numbers[0]), n_columns, separator)
    values = np.empty((len(numbers), n_columns if len(numbers) else 0))
    for begin in range(0, len(numbers), _CHUNK):
        fields: list[str] = []
        chunk = numbers[begin : begin + _CHUNK]
        for number in chunk:
            row = lines[number - 1].split(separator)
            if len(row) != n_columns:
                if len(row) < n_columns or any(map(str.strip, row[n_columns:])):
                    _complain(path, lines[number - 1], int(number), n_columns, separator)
                del row[n_columns:]
            fields += row
        try:
            flat = np.array([f or "nan" for f in fields], dtype=np.float64)
        except ValueError:
            flat = np.array([_number(path, chunk, i, f, n_columns) for i, f in enumerate(fields)])
        values[begin : begin + len(chunk)] = flat.reshape(len(chunk), n_columns)
    if np.isinf(values).any():
        row, column = (int(i) for i in np.argwhere(np.isinf(values))[0])
        place = f"line {numbers[row]}, column {column + 1}"
        raise FormatError(path, place, "a finite number", values[row, column])
    return values.reshape(len(numbers), n_columns) if len(numbers) else np.empty((0, 0)), numbers


def _number(path: Path, chunk: NDArray[np.int64], i: int, text: str, n_columns: int) -> float:
    text = text.strip()
    if text.lower() in _GAPS:
        return np.nan
    try:
        return float(text)
    except ValueError as error:
        place = f"line {chunk[i // n_columns]}, column {i % n_columns + 1}"
        raise FormatError(path, place, "a number or nothing", repr(text)) from error


def _complain(path: Path, line: str, number: int, n_columns: int, separator: str) -> None:
    n = line.count(separator) + 1
    hint = "the line is cut off or a column has no name"
    raise FormatError(path, f"line {number}", f"{n_columns} columns", f"{n}", hint)


def check_times(path: Path, times: NDArray[np.float64], numbers: NDArray[np.int64]) -> None:
    """Raise at the first line whose time is missing or not after the previous one."""
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise FormatError(path, f"line {numbers[bad[0]]}", "a time in seconds", "nothing")
    bad = np.flatnonzero(np.diff(times) <= 0)
    if len(bad):
        i = int(bad[0])
        raise FormatError(
            path, f"line {numbers[i + 1]}", f"a time after {times[i]:g} s", f"{times[i + 1]:g} s",
            "sort the rows by time, and keep one row a frame",
        )  # fmt: skip


def plain(name: str) -> str:
    """Return a name without tabs and line ends, which fits one field of a table."""
    return name.translate({ord(c): " " for c in "\t\r\n"})
