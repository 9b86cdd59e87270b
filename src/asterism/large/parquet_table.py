"""Plain tables in Parquet, read and written a row group at a time."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_extra
from asterism.errors import FormatError, not_read
from asterism.io.atomic import replacing
from asterism.large.columns import Columns, Layout
from asterism.large.rows import Chunk
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.large.rows import Writer

__all__ = ["ParquetTable"]

_ROWS = 2**17
"""Rows that are read at once, and the smallest row group that is written, of whole frames."""


@record(eq=False)
class ParquetTable:
    """Table in a Parquet file.

    Parameters
    ----------
    path : Path
        File.
    columns : Columns
        Names of its columns.

    Raises
    ------
    ParameterError
        If pyarrow is not installed.
    FormatError
        If the file cannot be read, is damaged or lacks a column.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyarrow as pa, pyarrow.parquet
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "two.parquet")
    ...     pa.parquet.write_table(pa.table({"frame": [0, 0], "x": [1, 3], "y": [2, 4]}), path)
    ...     [chunk.points.tolist() for chunk in ParquetTable(path=path).chunks()]
    [[[1.0, 2.0], [3.0, 4.0]]]
    """

    path: Path
    columns: Columns = Columns()

    def __post_init__(self) -> None:
        check_extra("Parquet", "parquet", "pyarrow")

    @property
    def layout(self) -> Layout:
        """Columns of the table."""
        with self._open() as file:
            return self._layout(file)

    def _layout(self, file: Any) -> Layout:
        import pyarrow.types as kinds

        schema = file.schema_arrow
        layout = self.columns.layout(self.path, schema.names)
        for name in layout.numbers:
            kind = schema.field(name).type
            if not (kinds.is_integer(kind) or kinds.is_floating(kind)):
                raise FormatError(self.path, f"column {name}", "numbers", str(kind))
        return layout

    def chunks(self) -> Iterator[Chunk]:
        """Yield the rows, at most `_ROWS` at a time.

        Raises
        ------
        FormatError
            If the file is damaged or a value is missing; the error names the row.
        """
        import pyarrow as pa

        with self._open() as file:
            layout = self._layout(file)
            first = 0
            batches = file.iter_batches(batch_size=_ROWS, use_threads=False)
            while (batch := self._next(batches, first)) is not None:
                values = np.stack([_floats(batch.column(name)) for name in layout.numbers], axis=1)
                rows = pa.Table.from_batches([batch])
                yield Chunk.of(
                    self.path, layout, values, rows, place=lambda i, f=first: f"row {f + i + 1}"
                )
                first += len(rows)

    def _next(self, batches: Iterator[Any], first: int) -> Any:
        try:
            return next(batches, None)
        except (OSError, ValueError) as error:
            raise self._damaged(f"after row {first}", error) from error

    @contextmanager
    def writing(self, out: Path) -> Generator[Writer, None, None]:
        """Open a table for the same rows with labels; the file appears when the block ends."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        with self._open() as file:
            label, schema = self._layout(file).label, file.schema_arrow
        schema = schema.append(pa.field(label, pa.int64()))
        with replacing(out) as target, pq.ParquetWriter(target, schema) as writer:
            made = _ParquetWriter(writer, schema)
            yield made
            made.flush()

    @contextmanager
    def _open(self) -> Generator[Any, None, None]:
        import pyarrow as pa
        import pyarrow.parquet as pq

        if not self.path.is_file():
            kind: type[OSError] = IsADirectoryError if self.path.is_dir() else FileNotFoundError
            raise not_read(self.path, kind())
        try:
            file = pq.ParquetFile(self.path, pre_buffer=False)  # else all that was read is kept
        except PermissionError as error:
            raise not_read(self.path, error) from error
        except (pa.ArrowException, OSError) as error:
            raise self._damaged("", error) from error
        with file:
            yield file

    def _damaged(self, place: str, error: Exception) -> FormatError:
        hint = "write the table again"
        return FormatError(self.path, place, "Parquet", f"a damaged file ({error})", hint)


class _ParquetWriter:
    """Collects frames until a row group is large enough."""

    def __init__(self, writer: Any, schema: Any) -> None:
        self._writer, self._schema = writer, schema
        self._parts: list[Any] = []
        self._n = 0

    def write(self, rows: list[Any], labels: NDArray[np.int64]) -> None:
        import pyarrow as pa

        together = pa.concat_tables(rows).append_column(self._schema.field(-1), pa.array(labels))
        self._parts.append(together)
        self._n += len(together)
        if self._n >= _ROWS:
            self.flush()

    def flush(self) -> None:
        import pyarrow as pa

        if self._parts:
            group = pa.concat_tables(self._parts).cast(self._schema)
            self._writer.write_table(group, row_group_size=max(self._n, 1))
        self._parts, self._n = [], 0


def _floats(column: Any) -> NDArray[np.float64]:
    """Return a column as floats; a null is NaN."""
    import pyarrow as pa

    values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.asarray(values, dtype=np.float64)
