"""TSV as Qualisys Track Manager exports it: a header of keys, then one row per frame.

Coordinates are millimetres. Gaps are blank, NULL or all zeros. The columns ``Frame`` and ``Time``
and their line of titles are an option of the export.
"""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError
from asterism.io.captures.frame_rows import capture_of, rows_of
from asterism.io.captures.rates import fixed_rate
from asterism.io.text_table import check_times, parse_rows, plain, read_lines
from asterism.model import Capture

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import Tracks

__all__ = ["read", "sniff", "write"]


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a Qualisys TSV."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(b"NO_OF_FRAMES")


def read(path: Path) -> Capture:
    """Read a Qualisys TSV of 3-D points.

    Parameters
    ----------
    path : Path
        TSV file.

    Returns
    -------
    Capture
        Detections with one identity for each named marker. `Capture.warnings` lists trajectories
        that the system filled or computed.

    Raises
    ------
    FormatError
        If the file holds no 3-D data, or a line is malformed; the error names it.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cube.tsv")
    ...     am.write(am.simulate.cube(frames=5, seed=1), path)
    ...     capture = read(path)
    >>> capture.units, capture.n_points
    ('mm', 40)
    """
    lines = read_lines(path)
    if not sniff(lines[0].encode()):
        raise FormatError(path, "line 1", "NO_OF_FRAMES and its value", repr(lines[0][:40]))
    header: dict[str, list[str]] = {}
    at = 0
    # Keys are in capitals; the first other line holds the titles or the data.
    while at < len(lines) and (key := lines[at].split("\t")[0].strip()).isupper():
        header[key] = [field.strip() for field in lines[at].split("\t")[1:]]
        at += 1
    included = header.get("DATA_INCLUDED", ["3D"])
    if included[:1] != ["3D"]:
        got = " ".join(included)
        hint = "export 3D data from Qualisys Track Manager"
        raise FormatError(path, "DATA_INCLUDED", "3D", repr(got), hint)
    rate = _number(path, header, "FREQUENCY")
    names = header.get("MARKER_NAMES")
    if names is None:
        raise FormatError(path, "the header", "MARKER_NAMES", "none")
    n_stated = int(_number(path, header, "NO_OF_MARKERS", float(len(names))))
    while len(names) > max(n_stated, 0) and not names[-1]:
        names.pop()

    has_time = at < len(lines) and lines[at].split("\t")[0].strip() == "Frame"
    n_leading = 2 if has_time else 0
    at += has_time
    values, numbers = parse_rows(path, lines, at, n_leading + 3 * len(names), "\t")
    values = values.reshape(len(numbers), n_leading + 3 * len(names))
    if has_time:
        times = values[:, 1]
        check_times(path, times, numbers)
    else:
        times = np.arange(len(values)) / (rate or 1.0)
    first = values[0, 0] if has_time and len(values) and np.isfinite(values[0, 0]) else 1
    kinds = header.get("TRAJECTORY_TYPES", [])
    filled = [f"{n} ({k})" for n, k in zip(names, kinds, strict=False) if k and k != "Measured"]
    warnings = [f"trajectories that were not measured: {', '.join(filled)}"] if filled else []
    n_frames = int(_number(path, header, "NO_OF_FRAMES", float(len(values))))
    if n_frames != len(values):
        warnings.append(f"the file has {len(values)} frames; the header states {n_frames}")
    return capture_of(
        path,
        "qtm",
        times,
        values[:, n_leading:].reshape(len(values), len(names), 3),
        names,
        unit="mm",
        rate=rate,
        first_frame=int(first),
        zero_is_gap=True,
        warnings=warnings,
    )


def _number(path: Path, header: dict[str, list[str]], key: str, default: float = 0.0) -> float:
    text = next(iter(header.get(key, [])), "")
    if not text:
        return default
    try:
        value = float(text)
    except ValueError as error:
        raise FormatError(path, key, "a number", repr(text)) from error
    if not 0 <= value < 1e9:
        raise FormatError(path, key, "a number from 0 to 1e9", text)
    return value


def write(tracks: Tracks, file: IO[bytes]) -> None:
    """Write tracks as a Qualisys TSV in millimetres.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 3-D detections at a fixed rate. Tracks without a name are called ``T000``,
        ``T001`` and so on; clutter is written to columns ``*0``, ``*1`` and so on.
    file : binary file
        Open file to write to.

    Raises
    ------
    ParameterError
        If the detections are 2-D or the times are irregular.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> file.getvalue().decode().splitlines()[0].split()
    ['NO_OF_FRAMES', '5']
    """
    d = tracks.detections
    rate = fixed_rate(d, "TSV")
    first = d.first_frame if isinstance(d, Capture) else 1
    names, rows = rows_of(tracks, "mm", zero_is_gap=True)
    names = [plain(name) for name in names]
    header = [
        ["NO_OF_FRAMES", str(d.n_frames)],
        ["NO_OF_CAMERAS", "0"],
        ["NO_OF_MARKERS", str(len(names))],
        ["FREQUENCY", f"{rate:.10g}"],
        ["NO_OF_ANALOG", "0"],
        ["ANALOG_FREQUENCY", "0"],
        ["DESCRIPTION", "--"],
        ["DATA_INCLUDED", "3D"],
        ["MARKER_NAMES", *names],
        ["TRAJECTORY_TYPES", *["Measured"] * len(names)],
        ["Frame", "Time", *(f"{name} {axis}" for name in names for axis in "XYZ")],
    ]
    for line in header:
        file.write(("\t".join(line) + "\n").encode())
    for t, (time, row) in enumerate(zip(d.times.tolist(), rows, strict=True)):
        file.write(("\t".join([str(first + t), repr(time), *row]) + "\n").encode())
