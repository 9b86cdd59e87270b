"""Binary logs of unlabelled point clouds, as librigidbodytracker writes them.

Little-endian records, one per frame: uint32 milliseconds, uint32 n, n × float32 x, y, z in metres.
"""

from __future__ import annotations

import struct
from typing import IO, TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError, ParameterError
from asterism.io.units import check_size, to_float32
from asterism.model import Capture

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import Detections, Tracks

__all__ = ["check", "read", "sniff", "write"]

_RECORD = struct.Struct("<II")
_POINT = 12  # bytes
_NEAREST, _FARTHEST = 1e-30, 1e6  # metres; limits of any coordinate but 0
_MOST_POINTS = 100_000  # in one frame; a text file that is read as a log claims far more


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are a chain of records with plausible points.

    The header of a C3D and some texts are such chains too, but their floats are not plausible.
    """
    at, last, n_records, n_points, is_rising = 0, -1, 0, 0, True
    while at + _RECORD.size <= len(head):
        time, n = _RECORD.unpack_from(head, at)
        if n > _MOST_POINTS or (n_records and abs(time - last) > 86_400_000):
            return False
        at += _RECORD.size
        n_here = min(n, (len(head) - at) // _POINT)
        size = np.abs(np.frombuffer(head, "<f4", 3 * n_here, at))
        if ((size > _FARTHEST) | ((size > 0) & (size < _NEAREST))).any():
            return False
        is_rising &= time > last
        at, last = at + _POINT * n, time
        n_records, n_points = n_records + 1, n_points + n_here
    is_chain = n_records > 0 and (at == len(head) or len(head) >= 4096)
    return is_chain and (n_points > 0 or (is_rising and n_records > 1))


def read(path: Path) -> Capture:
    """Read a binary log of point clouds.

    Parameters
    ----------
    path : Path
        Log file.

    Returns
    -------
    Capture
        Detections without identities: all labels are -1. Times begin at the first value of the
        recorded clock.

    Raises
    ------
    FormatError
        If a record is cut off, has a coordinate that is not finite, or has a time that is not
        after the previous one; the error names the record.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cube.log")
    ...     am.write(am.simulate.cube(frames=5, seed=1), path)
    ...     capture = read(path)
    >>> capture.n_points, int(capture.labels.max())
    (40, -1)
    """
    raw = path.read_bytes()
    times: list[int] = []
    counts: list[int] = []
    starts: list[int] = []
    at = 0
    while at < len(raw):
        place = f"record {len(times)}, byte {at}"
        if at + _RECORD.size > len(raw):
            raise FormatError(path, place, "8 bytes of time and count", f"{len(raw) - at}")
        time, n = _RECORD.unpack_from(raw, at)
        at += _RECORD.size
        if n * _POINT > len(raw) - at:
            raise FormatError(path, place, f"{n} points of 12 bytes", f"{len(raw) - at} bytes")
        if times and time <= times[-1]:
            raise FormatError(
                path, place, f"a time after {times[-1]} ms", f"{time} ms",
                "two recordings in one file, or a clock too coarse for the rate",
            )  # fmt: skip
        times.append(time)
        counts.append(n)
        starts.append(at)
        at += n * _POINT
    if not times:
        raise FormatError(path, "record 0", "a time and a count", "an empty file")
    blocks = [raw[start : start + n * _POINT] for start, n in zip(starts, counts, strict=True)]
    points = np.frombuffer(b"".join(blocks), "<f4").reshape(-1, 3)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        frame = int(np.searchsorted(offsets, bad[0], side="right")) - 1
        place = f"record {frame}, point {bad[0] - offsets[frame]}"
        raise FormatError(path, place, "finite coordinates", points[bad[0]])
    none = np.full(len(points), -1, dtype=np.int64)
    return Capture(
        times=np.array(times) / 1000,
        offsets=offsets,
        points=points.astype(np.float64),
        path=path,
        format="pointcloud",
        channels=none,
        labels=none,
        warnings=check_size(points, "m"),
    )


def write(tracks: Tracks, file: IO[bytes]) -> None:
    """Write the detections of tracks as a binary log, without their identities.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 3-D detections. Times must be at least 0 and differ by a millisecond or more,
        because the log counts whole milliseconds.
    file : binary file
        Open file to write to.

    Raises
    ------
    ParameterError
        If the points are 2-D, exceed 32-bit floats, or have other times.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> len(file.getvalue())  # 5 records of 8 bytes with 8 points of 12 bytes each
    520
    """
    d = tracks.detections
    check(d)
    milliseconds = np.round(d.times * 1000)
    points = to_float32(d.points)
    for t, time in enumerate(milliseconds.astype(np.int64).tolist()):
        begin, end = int(d.offsets[t]), int(d.offsets[t + 1])
        file.write(_RECORD.pack(time, end - begin) + points[begin:end].tobytes())


def check(detections: Detections) -> None:
    """Raise unless a log can hold points of these axes and times.

    Parameters
    ----------
    detections : Detections
        Points to write.

    Raises
    ------
    ParameterError
        If the points are 2-D, or the times are negative or nearer than a millisecond.
    """
    if detections.n_axes != 3:
        hint = "write CSV, which takes 2-D points"
        raise ParameterError("tracks", "3-D points, because the log holds no others", "2-D", hint)
    milliseconds = np.round(detections.times * 1000)
    if len(milliseconds) and (
        milliseconds[0] < 0 or milliseconds[-1] >= 2**32 or (np.diff(milliseconds) <= 0).any()
    ):
        expected = "times of at least 0 that differ by a millisecond or more"
        raise ParameterError("times", expected, "others", "write CSV, which keeps any times")
