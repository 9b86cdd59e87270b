"""TRC, the marker file of OpenSim and Motion Analysis: text with tabs, one row per frame.

Gaps are blank fields: OpenSim would read zeros as points, and NaN stops inverse kinematics.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError
from asterism.io.captures.frame_rows import capture_of, rows_of
from asterism.io.captures.rates import fixed_rate
from asterism.io.text_table import check_times, parse_rows, plain, read_lines
from asterism.io.units import judge_unit, parse_unit
from asterism.model import Capture

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["read", "sniff", "write"]


_KEYS = (
    "DataRate", "CameraRate", "NumFrames", "NumMarkers",
    "Units", "OrigDataRate", "OrigDataStartFrame", "OrigNumFrames",
)  # fmt: skip


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a TRC file."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"PathFileType")


def read(path: Path) -> Capture:
    """Read a TRC file.

    Parameters
    ----------
    path : Path
        TRC file. Its unit is that of the header, or else is estimated from the coordinates.

    Returns
    -------
    Capture
        Detections with one identity for each named marker, at the times of the file's column.

    Raises
    ------
    FormatError
        If a line is malformed; the error names it.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cube.trc")
    ...     am.write(am.simulate.cube(frames=5, seed=1), path)
    ...     capture = read(path)
    >>> capture.units, capture.n_points
    ('mm', 40)
    """
    lines = read_lines(path)
    if not sniff(lines[0].encode()) or len(lines) < 5:
        expected = "'PathFileType' and a header of 5 lines"
        raise FormatError(path, "line 1", expected, repr(lines[0][:40]))
    keys, given = (line.strip("\t ").split("\t") for line in lines[1:3])
    header = dict(zip(map(str.strip, keys), map(str.strip, given), strict=False))
    titles = lines[3].rstrip("\t ").split("\t")
    if [t.strip().lower() for t in titles[:2]] != ["frame#", "time"]:
        raise FormatError(path, "line 4", "'Frame#', 'Time' and marker names", repr(lines[3][:40]))
    # A name stands over the first of its three columns.
    names = [name.strip() for name in titles[2::3]]
    stray = [name for i, name in enumerate(titles[2:]) if i % 3 and name.strip()]
    if stray:
        raise FormatError(path, "line 4", "three tabs from name to name", repr(stray[0]))
    # An exporter may trim the blanks of unnamed markers at the end of the line.
    axes = [axis for axis in lines[4].split("\t") if axis.strip()]
    n_markers = min(_count(header, "NumMarkers", len(names)), len(axes) // 3)
    names += [""] * (n_markers - len(names))
    values, numbers = parse_rows(path, lines, 5, 2 + 3 * len(names), "\t")
    values = values.reshape(len(numbers), 2 + 3 * len(names))
    check_times(path, values[:, 1], numbers)

    warnings: list[str] = []
    coordinates = values[:, 2:].reshape(len(values), len(names), 3)
    stated = header.get("Units", "")
    unit = parse_unit(stated)
    is_stated = unit is not None
    if unit is None:
        unit = judge_unit(coordinates[np.isfinite(coordinates).all(axis=2)])
        warnings.append(f"Units is {stated!r}: by their size the coordinates are {unit}")
    first = values[0, 0] if len(values) and np.isfinite(values[0, 0]) else 1
    n_frames = _count(header, "NumFrames", len(values))
    if n_frames != len(values):
        warnings.append(f"the file has {len(values)} frames; the header states {n_frames}")
    return capture_of(
        path,
        "trc",
        values[:, 1],
        coordinates,
        names,
        unit=unit,
        rate=_rate(header),
        first_frame=int(first),
        zero_is_gap=True,
        is_stated=is_stated,
        warnings=warnings,
    )


def _count(header: dict[str, str], key: str, default: int) -> int:
    text = header.get(key, "")
    return int(text) if text.isdecimal() and len(text) < 10 else default


def _rate(header: dict[str, str]) -> float:
    for key in ("DataRate", "CameraRate"):
        try:
            rate = float(header.get(key, ""))
        except ValueError:
            continue
        if 1e-6 < rate < 1e9:
            return rate
    return 0.0


def write(tracks: Tracks, file: IO[bytes]) -> None:
    r"""Write tracks as TRC, in the unit of their source file or else in millimetres.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 3-D detections at a fixed rate. Tracks without a name are called ``T000``,
        ``T001`` and so on; clutter is written to columns ``*0``, ``*1`` and so on.
    file : binary file
        Open file to write to; the header holds its name.

    Raises
    ------
    ParameterError
        If the detections are 2-D or the times are irregular.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> file.getvalue().decode().splitlines()[3].split("\t")[:2]
    ['Frame#', 'Time']
    """
    d = tracks.detections
    rate = fixed_rate(d, "TRC")
    unit, first = (d.units, d.first_frame) if isinstance(d, Capture) else ("mm", 1)
    names, rows = rows_of(tracks, unit, zero_is_gap=True)
    axes = [f"{axis}{i + 1}" for i in range(len(names)) for axis in "XYZ"]
    spread = [text for name in names for text in (plain(name), "", "")]
    counts = [rate, rate, d.n_frames, len(names), unit, rate, first, d.n_frames]
    header = [
        ["PathFileType", "4", "(X/Y/Z)", plain(Path(getattr(file, "name", "tracks.trc")).name)],
        list(_KEYS),
        [f"{c:.10g}" if isinstance(c, float) else str(c) for c in counts],
        ["Frame#", "Time", *spread],
        ["", "", *axes],
        [],
    ]
    for line in header:
        file.write(("\t".join(line) + "\n").encode())
    for t, (time, row) in enumerate(zip(d.times.tolist(), rows, strict=True)):
        end = "\n" if row and row[-1] else "\t\n"  # OpenSim does not count a blank field at the end
        file.write(("\t".join([str(first + t), repr(time), *row]) + end).encode())
