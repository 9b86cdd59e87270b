"""CSV as OptiTrack Motive exports it: several header rows define the columns.

Only measured markers are detections. Poses of rigid bodies and bones, and the marker positions that
their models predict, are computed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError
from asterism.io.captures.frame_rows import capture_of
from asterism.io.text_table import cells_of, check_times, parse_rows, read_lines
from asterism.io.units import parse_unit

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import Capture

__all__ = ["read", "sniff"]

_MOST_HEADER = 12  # rows


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a Motive export."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(b"Format Version")


def read(path: Path) -> Capture:
    r"""Read the measured markers of a Motive export.

    Parameters
    ----------
    path : Path
        CSV file in the unit of its header.

    Returns
    -------
    Capture
        Detections of the columns of type Marker. Rigid bodies, bones and their predicted markers
        are listed in `Capture.modelled`.

    Raises
    ------
    FormatError
        If the header has no column of type Marker, or a line is malformed; the error names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> rows = ["Format Version,1.23,Length Units,Meters", ",Type,Marker,Marker,Marker",
    ...         ",Name,LASI,LASI,LASI", ",,Position,Position,Position",
    ...         "Frame,Time (Seconds),X,Y,Z", "0,0.0,0.5,1.2,0.9"]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "take.csv")
    ...     _ = path.write_text("\n".join(rows))
    ...     read(path).names
    ('LASI',)
    """
    lines = read_lines(path)
    rows = [cells_of(line) for line in lines[:_MOST_HEADER]]
    titles_at = next((i for i, row in enumerate(rows) if row[:1] == ["Frame"]), None)
    if not sniff(lines[0].encode()) or titles_at is None:
        expected = "'Format Version' in line 1 and 'Frame, Time (Seconds), X, Y, Z …' below"
        raise FormatError(path, "the header", expected, repr(lines[0][:40]))
    facts = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    titles = rows[titles_at]
    # The second cell is the name of the row; the row of Position and Rotation has none.
    kinds, names, what = (
        next((row for row in rows[1:titles_at] if row[1:2] == [key]), [])
        for key in ("Type", "Name", "")
    )
    what = rows[titles_at - 1]
    n_columns = len(titles)
    kinds, names, what = (row + [""] * (n_columns - len(row)) for row in (kinds, names, what))
    starts = [
        c
        for c in range(2, n_columns - 2)
        if what[c] == "Position" and titles[c : c + 3] == ["X", "Y", "Z"]
    ]
    markers = [c for c in starts if kinds[c] == "Marker"]
    computed = [names[c] for c in starts if kinds[c] != "Marker"]
    if not markers:
        got = ", ".join(dict.fromkeys(kind for kind in kinds[2:] if kind)) or "none"
        hint = "tick Markers and Unlabeled Markers when exporting from Motive"
        raise FormatError(path, "the header", "columns of type Marker", got, hint)
    stated = facts.get("Length Units", "Meters")
    unit = parse_unit(stated)
    if unit is None:
        expected = "Meters, Centimeters, Millimeters, Inches or Feet"
        raise FormatError(path, "Length Units", expected, stated)
    values, numbers = parse_rows(path, lines, titles_at + 1, n_columns, ",")
    values = values.reshape(len(numbers), n_columns)
    check_times(path, values[:, 1], numbers)
    columns = np.array([[c, c + 1, c + 2] for c in markers])
    first = values[0, 0] if len(values) and np.isfinite(values[0, 0]) else 0
    return capture_of(
        path,
        "motive",
        values[:, 1],
        values[:, columns],
        [names[c] for c in markers],
        unit=unit,
        rate=_rate(facts),
        first_frame=int(first),
        zero_is_gap=True,
        modelled=computed,
    )


def _rate(facts: dict[str, str]) -> float:
    for key in ("Export Frame Rate", "Capture Frame Rate"):
        try:
            rate = float(facts.get(key, ""))
        except ValueError:
            continue
        if 1e-6 < rate < 1e9:
            return rate
    return 0.0
