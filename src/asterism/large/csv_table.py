"""Plain tables as text, read and written a part at a time. The text of a row is kept as it is."""

from __future__ import annotations

import csv
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from asterism.errors import FormatError, not_read
from asterism.io.atomic import replacing
from asterism.large.columns import Columns, Layout
from asterism.large.rows import Chunk
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.large.rows import Writer

__all__ = ["CsvTable"]

_BYTES = 2**22  # of text that are parsed at once
_DELIMITERS = ",;\t"


@record(eq=False)
class CsvTable:
    r"""Table of comma-, semicolon- or tab-separated values with a header, in UTF-8.

    Parameters
    ----------
    path : Path
        File.
    columns : Columns
        Names of its columns.

    Raises
    ------
    FormatError
        If the file cannot be read or lacks a column.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "two.csv")
    ...     _ = path.write_text("t,x,y\n0,1,2\n0,3,4\n")
    ...     [chunk.points.tolist() for chunk in CsvTable(path=path).chunks()]
    [[[1.0, 2.0], [3.0, 4.0]]]
    """

    path: Path
    columns: Columns = Columns()

    def _header(self, file: IO[str]) -> tuple[str, str, list[str]]:
        """Read the header: its text, its delimiter and the names of the columns."""
        text = file.readline().rstrip("\n")
        if not text.strip():
            raise FormatError(self.path, "line 1", "a header with the names of columns", "nothing")
        delimiter = max(_DELIMITERS, key=text.count)
        names = next(csv.reader([text], delimiter=delimiter))
        return text, delimiter, [name.strip() for name in names]

    @property
    def layout(self) -> Layout:
        """Columns of the table."""
        with self._open() as file:
            return self.columns.layout(self.path, self._header(file)[2])

    def chunks(self) -> Iterator[Chunk]:
        """Yield the rows, some megabytes at a time.

        Raises
        ------
        FormatError
            If a line is malformed; the error names it.
        """
        with self._open() as file:
            _, delimiter, names = self._header(file)
            layout = self.columns.layout(self.path, names)
            wanted = [names.index(name) for name in layout.numbers]
            number = 2  # of the next line
            while lines := file.readlines(_BYTES):
                places = np.arange(number, number + len(lines))
                number += len(lines)
                texts = [line.rstrip("\n") for line in lines]
                if not all(map(str.strip, texts)):
                    places = places[[bool(text.strip()) for text in texts]]
                    texts = [text for text in texts if text.strip()]
                values = _numbers(texts, delimiter, wanted, len(names))
                if values is None:
                    raise self._wrong(texts, places, delimiter, names, layout)
                yield Chunk.of(
                    self.path, layout, values, texts, place=lambda i, p=places: f"line {p[i]}"
                )

    @contextmanager
    def writing(self, out: Path) -> Generator[Writer, None, None]:
        """Open a table for the same rows with labels; the file appears when the block ends."""
        with self._open() as file:
            text, delimiter, names = self._header(file)
        label = self.columns.layout(self.path, names).label
        with replacing(out) as target:
            target.write(f"{text}{delimiter}{label}\n".encode())
            yield _CsvWriter(target, delimiter)

    @contextmanager
    def _open(self) -> Generator[IO[str], None, None]:
        try:
            with self.path.open(encoding="utf-8-sig") as file:
                yield file
        except OSError as error:
            raise not_read(self.path, error) from error
        except UnicodeDecodeError as error:
            raise FormatError(self.path, "", "text in UTF-8", str(error)) from error

    def _wrong(
        self,
        texts: Sequence[str],
        places: NDArray[np.int64],
        delimiter: str,
        names: Sequence[str],
        layout: Layout,
    ) -> FormatError:
        """Return the error of the first line that cannot be parsed."""
        for text, place in zip(texts, places, strict=True):
            if text.count('"') % 2:
                return FormatError(self.path, f"line {place}", "closed quotation marks", text)
            cells = next(csv.reader([text], delimiter=delimiter))
            if len(cells) != len(names):
                expected, found = f"{len(names)} columns", len(cells)
                return FormatError(self.path, f"line {place}", expected, found)
            for name in layout.numbers:
                cell = cells[names.index(name)]
                try:
                    float(cell)
                except ValueError:
                    at, hint = f"line {place}, column {name}", "leave out rows without a position"
                    return FormatError(self.path, at, "a number", repr(cell)[:60], hint)
        return FormatError(self.path, f"lines {places[0]} to {places[-1]}", "CSV", "other text")


class _CsvWriter:
    def __init__(self, file: IO[bytes], delimiter: str) -> None:
        self._file, self._delimiter = file, delimiter

    def write(self, rows: list[Any], labels: NDArray[np.int64]) -> None:
        texts = (text for part in rows for text in part)
        mark = self._delimiter
        both = zip(texts, labels.tolist(), strict=True)
        self._file.write("".join(f"{text}{mark}{label}\n" for text, label in both).encode())


def _numbers(
    texts: list[str], delimiter: str, wanted: list[int], width: int
) -> NDArray[np.float64] | None:
    """Parse some of `width` columns; None if a line cannot be parsed."""
    if not texts:
        return np.zeros((0, len(wanted)))
    for text in texts:
        if '"' not in text:
            if text.count(delimiter) + 1 != width:
                return None
        elif text.count('"') % 2 or len(next(csv.reader([text], delimiter=delimiter))) != width:
            return None
    try:
        return np.loadtxt(
            texts, delimiter=delimiter, usecols=wanted, comments=None, quotechar='"', ndmin=2
        )
    except ValueError:
        return None
