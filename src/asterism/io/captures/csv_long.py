"""Asterism's own CSV: one row per detection, without loss.

Columns ``frame, time_s, x_m, y_m, z_m, track, name, confidence, identity_confidence, filled, std,
source_unit``; ``z_m`` is absent in 2-D, and each of the last five if it has no values. Coordinates
are metres. Clutter is track -1; ``filled`` is 1 for a point that was not measured; ``std`` is the
standard deviation of a coordinate in metres, 0 if it is not known. ``source_unit`` is the unit of
the source file if that is not metres; formats with a unit are written in it again. It is the same
in all rows. A row without coordinates is a frame without points; a row without frame and time
declares a track without a detection. Floats have enough digits to restore the same bits. Tabs and
line ends in a name become blanks.
"""

from __future__ import annotations

from itertools import repeat
from typing import IO, TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError
from asterism.io.csv_columns import SOURCE_UNIT, columns_of, quoted, source_unit
from asterism.io.text_table import cells_of, check_times, plain, read_lines
from asterism.io.units import check_size
from asterism.model import Capture, Tracks

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read", "read_tracks", "sniff", "write"]

_COLUMNS = ("frame", "time_s", "x_m", "y_m", "z_m", "track", "name", "confidence",
            "identity_confidence", "filled", "std", SOURCE_UNIT)  # fmt: skip
_TEXTS = ("name", SOURCE_UNIT)
_REQUIRED = ("frame", "time_s", "x_m", "y_m")
_CHUNK = 4096  # lines or frames at a time
_MOST_TRACKS = 10**6  # a larger number is an error and would exhaust the memory


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of this CSV, with a column ``x_m``."""
    line = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")[0].decode("latin-1").strip()
    return "x_m" in line.replace('"', "").replace(" ", "").split(",")


def read(path: Path) -> Capture:
    """Read the detections of Asterism's CSV, with the tracks as their identities.

    Parameters
    ----------
    path : Path
        CSV file. Columns and rows may stand in any order.

    Returns
    -------
    Capture
        Detections, labels and names. `read_tracks` returns the confidences too.

    Raises
    ------
    FormatError
        If a line is malformed; the error names it.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cube.csv")
    ...     am.write(am.simulate.cube(frames=5, seed=1), path)
    ...     read(path).n_points
    40
    """
    return _load(path)[0]


def read_tracks(path: Path) -> Tracks:
    r"""Read the tracks of Asterism's CSV, with their labels, names and confidences.

    Parameters
    ----------
    path : Path
        CSV file. Columns and rows may stand in any order.

    Returns
    -------
    Tracks
        Tracks over a `Capture` of the file. Without a column ``track`` all detections are clutter.

    Raises
    ------
    FormatError
        If a line is malformed; the error names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "one.csv")
    ...     _ = path.write_text("frame,time_s,x_m,y_m,z_m,track,name\n1,0,0.5,1.2,0.9,0,LASI\n")
    ...     read_tracks(path).names
    ('LASI',)
    """
    return _load(path)[1]


def _header(path: Path, line: str) -> list[str]:
    """Read the names of the columns."""
    header = cells_of(line)
    unknown = [name for name in header if name not in _COLUMNS]
    missing = [name for name in _REQUIRED if name not in header]
    if unknown or missing or len(set(header)) < len(header):
        got = ", ".join(header)[:200]
        raise FormatError(path, "line 1", f"the columns {', '.join(_COLUMNS)}", got)
    return header


def _load(path: Path) -> tuple[Capture, Tracks]:
    lines = read_lines(path)
    while len(lines) > 1 and not lines[-1].strip():
        lines.pop()
    header = _header(path, lines[0])
    numbers, texts = columns_of(path, lines, header, _TEXTS)
    nothing = np.full(len(lines) - 1, np.nan)
    numbers = dict.fromkeys(("track",), nothing) | numbers
    names = texts.get("name", [""] * len(nothing))
    frame, time = numbers["frame"], numbers["time_s"]
    track = _whole(path, "track", np.nan_to_num(numbers["track"], nan=-1.0), -1, _MOST_TRACKS)
    axes = [axis for axis in ("x_m", "y_m", "z_m") if axis in header]
    points = np.stack([numbers[axis] for axis in axes], axis=1)

    n_given = np.isfinite(points).sum(axis=1)
    is_declaration = np.isnan(frame) & np.isnan(time) & (n_given == 0)
    bad = np.flatnonzero(
        ~is_declaration & ~(np.isfinite(frame) & np.isfinite(time))
        | (n_given > 0) & (n_given < points.shape[1])
    )
    if len(bad):
        expected = "a frame, a time and all coordinates or none, all finite"
        raise FormatError(path, f"line {bad[0] + 2}", expected, "a part of them")
    rows = np.flatnonzero(~is_declaration)
    rows = rows[np.argsort(frame[rows], kind="stable")]
    begins = np.flatnonzero(np.diff(frame[rows], prepend=-np.inf) > 0)
    index = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(rows))))
    times = time[rows[begins]]
    bad = rows[time[rows] != times[index]]
    if len(bad):
        expected = f"the time of the other rows of frame {frame[bad[0]]:g}"
        raise FormatError(path, f"line {bad[0] + 2}", expected, f"{time[bad[0]]:g}")
    check_times(path, times, rows[begins] + 2)

    is_point = n_given[rows] > 0
    kept = rows[is_point]
    counts = np.bincount(index[is_point], minlength=len(begins))
    numbered = _whole(path, "frame", frame[rows[begins]], -(2**53), 2**53)
    track_names = _names(path, track, names)
    filled = numbers.get("filled")
    if filled is not None:
        filled = _whole(path, "filled", filled[kept], 0, 1).astype(np.bool_)
    unit = source_unit(path, texts.get(SOURCE_UNIT, []))
    capture = Capture(
        times=times,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        points=points[kept],
        filled=filled,
        stds=numbers["std"][kept] if "std" in header else None,
        path=path,
        format="csv",
        first_frame=int(numbered[0]) if len(numbered) else 1,
        units=unit,
        channels=np.full(len(kept), -1),
        labels=track[kept],
        names=track_names,
        warnings=check_size(points[kept], unit),
    )

    def sure(name: str) -> NDArray[np.float64] | None:
        return numbers[name][kept] if name in header else None

    tracks = Tracks(
        detections=capture,
        labels=track[kept],
        names=track_names,
        confidence=sure("confidence"),
        identity_confidence=sure("identity_confidence"),
    )
    return capture, tracks


def _whole(
    path: Path, column: str, values: NDArray[np.float64], low: int, high: int
) -> NDArray[np.int64]:
    bad = np.flatnonzero(~((values >= low) & (values <= high) & (values == np.floor(values))))
    if len(bad):
        expected = f"whole numbers from {low} to {high}"
        raise FormatError(path, f"column {column}", expected, f"{values[bad[0]]:g}")
    return values.astype(np.int64)


def _names(path: Path, track: NDArray[np.int64], names: list[str]) -> tuple[str | None, ...]:
    result: list[str | None] = [None] * (int(track.max(initial=-1)) + 1)
    pairs = list(zip(track.tolist(), names, strict=True))
    for k, name in dict.fromkeys(pairs):
        if k >= 0 and name:
            if result[k] is not None:
                line = f"line {pairs.index((k, name)) + 2}"
                raise FormatError(path, line, f"one name for track {k}, {result[k]!r}", repr(name))
            result[k] = name
    return tuple(result)


def write(tracks: Tracks, file: IO[bytes]) -> None:
    """Write tracks as Asterism's CSV, from which `read_tracks` returns the same tracks.

    Labels, names, confidences, points, flags of filled points and standard deviations are kept bit
    for bit.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 2-D or 3-D detections at any times.
    file : binary file
        Open file to write to.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> file.getvalue().decode().splitlines()[0]
    'frame,time_s,x_m,y_m,z_m,track,name'
    """
    d = tracks.detections
    filled = None if d.filled is None else d.filled.astype(np.int64)
    more = {
        "confidence": tracks.confidence,
        "identity_confidence": tracks.identity_confidence,
        "filled": filled,
        "std": d.stds,
    }
    last = {name: values for name, values in more.items() if values is not None}
    unit = d.units if isinstance(d, Capture) and d.units != "m" else ""
    absent = {*more, SOURCE_UNIT} | ({"z_m"} if d.n_axes == 2 else set[str]())
    header = [c for c in _COLUMNS if c not in absent] + [*last] + [SOURCE_UNIT] * bool(unit)
    file.write((",".join(header) + "\n").encode())
    tails = [f"{k},{quoted(plain(name or ''))}" for k, name in enumerate(tracks.names)] + ["-1,"]
    first = d.first_frame if isinstance(d, Capture) else 1
    starts = [f"{first + t},{time!r}" for t, time in enumerate(d.times.tolist())]
    end_of_blank = f",{unit}" if unit else ""
    blank = "," * (len(header) - 2 - bool(unit)) + end_of_blank
    for begin in range(0, d.n_frames, _CHUNK):
        end = min(begin + _CHUNK, d.n_frames)
        rows = slice(int(d.offsets[begin]), int(d.offsets[end]))
        columns = [map(starts.__getitem__, d.frame_of[rows].tolist())]
        columns += [map(repr, d.points[rows, axis].tolist()) for axis in range(d.n_axes)]
        columns.append(map(tails.__getitem__, tracks.labels[rows].tolist()))
        columns += [map(repr, values[rows].tolist()) for values in last.values()]
        columns += [repeat(unit, rows.stop - rows.start)] * bool(unit)
        lines = list(map(",".join, zip(*columns, strict=True)))
        # Backwards, so that the earlier places stay valid.
        for t in begin + np.flatnonzero(d.counts[begin:end] == 0)[::-1]:
            lines.insert(int(d.offsets[t]) - rows.start, starts[t] + blank)
        file.write("".join(f"{line}\n" for line in lines).encode())
    for k in np.flatnonzero(tracks.lengths == 0):
        line = "," * (2 + d.n_axes) + tails[k] + "," * len(last) + end_of_blank
        file.write(f"{line}\n".encode())
