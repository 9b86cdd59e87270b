"""CSV with one row per frame and three columns per marker: ``time_s, LASI_x, LASI_y, LASI_z, …``.

Coordinates are metres; gaps are blank fields; 2-D files have no columns ``_z``. A last column
``source_unit`` names the unit of the source file if that is not metres.
"""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from typing import IO, TYPE_CHECKING

from asterism.errors import FormatError
from asterism.io.captures.frame_rows import capture_of, rows_of
from asterism.io.csv_columns import SOURCE_UNIT, source_unit
from asterism.io.text_table import cells_of, check_times, parse_rows, plain, read_lines
from asterism.model import Capture

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import Tracks

__all__ = ["read", "sniff", "write"]


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of this CSV, with ``time_s`` first."""
    cells = cells_of(head.removeprefix(b"\xef\xbb\xbf").split(b"\n")[0].decode("latin-1"))
    # A long header may be cut off in the middle of a name.
    return cells[:1] == ["time_s"] and (len(cells) == 1 or cells[1].endswith("_x"))


def read(path: Path) -> Capture:
    r"""Read a CSV with one row per frame.

    Parameters
    ----------
    path : Path
        CSV file.

    Returns
    -------
    Capture
        Detections with one identity for each named marker.

    Raises
    ------
    FormatError
        If a line is malformed; the error names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "wide.csv")
    ...     _ = path.write_text("time_s,LASI_x,LASI_y,LASI_z\n0,0.5,1.2,0.9\n0.01,,,\n")
    ...     capture = read(path)
    >>> capture.names, capture.counts.tolist()
    (('LASI',), [1, 0])
    """
    lines = read_lines(path)
    titles = cells_of(lines[0])
    unit = "m"
    if titles[-1:] == [SOURCE_UNIT]:
        titles.pop()
        rows = [line.rpartition(",") for line in lines]
        lines = [row[0] for row in rows]
        unit = source_unit(path, [row[2].strip() for row in rows[1:]])
    is_flat = len(titles) > 1 and not any(title.endswith("_z") for title in titles)
    axes = "xy" if is_flat else "xyz"
    names = [title[:-2] for title in titles[1 :: len(axes)]]
    wanted = ["time_s"] + [f"{name}_{axis}" for name in names for axis in axes]
    if titles != wanted:
        odd = next((t for t, w in zip(titles, wanted, strict=False) if t != w), "")
        expected = "'time_s', then NAME_x, NAME_y, NAME_z for each marker"
        raise FormatError(path, "line 1", expected, f"{odd!r} instead" if odd else "fewer")
    values, numbers = parse_rows(path, lines, 1, len(titles), ",")
    values = values.reshape(len(numbers), len(titles))
    check_times(path, values[:, 0], numbers)
    capture = capture_of(
        path,
        "csv-wide",
        values[:, 0],
        values[:, 1:].reshape(len(values), len(names), len(axes)),
        names,
        unit="m",
        zero_is_gap=False,
    )
    return capture if unit == "m" else replace(capture, units=unit)


def write(tracks: Tracks, file: IO[bytes]) -> None:
    """Write tracks as a CSV with one row per frame.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 2-D or 3-D detections. Tracks without a name are called ``T000``, ``T001`` and
        so on; clutter is written to columns ``*0``, ``*1`` and so on.
    file : binary file
        Open file to write to.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> len(file.getvalue().splitlines())
    6
    """
    names, rows = rows_of(tracks, "m", zero_is_gap=False)
    axes = "xyz"[: tracks.detections.n_axes]
    header = io.StringIO()
    titles = ["time_s"] + [f"{plain(name)}_{axis}" for name in names for axis in axes]
    d = tracks.detections
    unit = [d.units] if isinstance(d, Capture) and d.units != "m" else []
    csv.writer(header, lineterminator="\n").writerow(titles + [SOURCE_UNIT] * len(unit))
    file.write(header.getvalue().encode())
    for time, row in zip(d.times.tolist(), rows, strict=True):
        file.write((",".join([repr(time), *row, *unit]) + "\n").encode())
