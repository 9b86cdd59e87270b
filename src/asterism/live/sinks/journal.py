"""Journal of a recording: frames that are on disk as soon as they are written.

The file begins with `MAGIC` and a record that holds the header as JSON. Each record is its size and
its CRC-32 (two unsigned 32-bit integers, little endian) and a body. A frame has its number
(int64), its time (float64), the number of points N and the length of the names (two uint32),
N × 3 coordinates (float64, metres), N labels (int64), and the names that are new or have changed as
a JSON object of name by label. A process that is killed leaves at most one incomplete record at the
end, which is ignored.
"""

from __future__ import annotations

import json
import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import FormatError, not_read
from asterism.model import Detections, Tracks

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.live.frame import LiveFrame, StreamHeader

__all__ = ["MAGIC", "frame_record", "header_record", "read_journal"]

MAGIC = b"asterism journal 1\n"
_HEAD = struct.Struct("<II")
_FRAME = struct.Struct("<qdII")
_LONGEST = 2**28  # bytes of a record
_LONGEST_PAUSE = 10.0  # seconds; a longer pause is shortened to it


def header_record(header: StreamHeader) -> bytes:
    """Return the first bytes of a journal."""
    facts = {"source": header.source, "rate": header.rate, "names": header.names}
    return MAGIC + _record(json.dumps(facts).encode())


def frame_record(frame: LiveFrame, known: dict[int, str]) -> bytes:
    """Return the record of a frame, and note the names that it states.

    Parameters
    ----------
    frame : LiveFrame
        The frame.
    known : dict of int to str
        Names by label that earlier records state; new ones are added.
    """
    new = {
        label: name
        for label, name in zip(frame.labels.tolist(), frame.names or (), strict=False)
        if name is not None and label >= 0 and known.get(label) != name
    }
    known |= new
    names = json.dumps(new).encode() if new else b""
    points = np.ascontiguousarray(frame.points, "<f8").tobytes()
    labels = np.ascontiguousarray(frame.labels, "<i8").tobytes()
    head = _FRAME.pack(int(frame.number), float(frame.time), len(frame.points), len(names))
    return _record(head + points + labels + names)


def _record(body: bytes) -> bytes:
    return _HEAD.pack(len(body), zlib.crc32(body)) + body


def read_journal(path: Path) -> Tracks:
    """Read the tracks of a journal.

    The frames are counted at the rate of the stream: lost frames are frames without points, and a
    pause of more than ten seconds is shortened to ten seconds. A track has the last name that was
    stated for it; tracks of one name are one track where they do not overlap.

    Parameters
    ----------
    path : Path
        The journal.

    Returns
    -------
    Tracks

    Raises
    ------
    FormatError
        If it is not a journal, or cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise not_read(path, error) from error
    if not data.startswith(MAGIC):
        raise FormatError(path, "the beginning", "a journal of asterism", repr(data[:16]))
    bodies = _bodies(data)
    header: dict[str, Any] = json.loads(next(bodies, b"{}"))
    numbers: list[float] = []
    points: list[NDArray[np.float64]] = []
    labels: list[NDArray[np.int64]] = []
    names: dict[int, str] = {}
    for body in bodies:
        _, time, n, n_names = _FRAME.unpack_from(body)
        at = _FRAME.size
        points.append(np.frombuffer(body, "<f8", count=3 * n, offset=at).reshape(n, 3))
        labels.append(np.frombuffer(body, "<i8", count=n, offset=at + 24 * n))
        numbers.append(time)
        if n_names:
            stated = json.loads(bytes(body[at + 32 * n :]))
            names |= {int(label): name for label, name in stated.items()}
    return _tracks(header, np.array(numbers), points, labels, names)


def _bodies(data: bytes) -> Any:
    """Yield the bodies of the records up to the first that is not complete."""
    view, at = memoryview(data), len(MAGIC)
    while at + _HEAD.size <= len(view):
        size, crc = _HEAD.unpack_from(view, at)
        body = view[at + _HEAD.size : at + _HEAD.size + size]
        if size > _LONGEST or len(body) < size or zlib.crc32(body) != crc:
            return
        at += _HEAD.size + size
        yield bytes(body)


def _tracks(
    header: dict[str, Any],
    times: NDArray[np.float64],
    points: list[NDArray[np.float64]],
    labels: list[NDArray[np.int64]],
    names: dict[int, str],
) -> Tracks:
    rate = float(header.get("rate") or 0.0)
    steps = np.diff(times)
    if not rate:
        forward = steps[steps > 0]
        rate = round(1 / float(np.median(forward)), 3) if len(forward) else 100.0
    moves = np.clip(np.rint(steps * rate), 1, max(1, round(rate * _LONGEST_PAUSE)))
    frames = np.concatenate([[0], np.cumsum(moves)]).astype(np.int64)[: len(times)]
    n_frames = int(frames[-1]) + 1 if len(frames) else 0
    counts = np.zeros(n_frames, dtype=np.int64)
    counts[frames] = [len(each) for each in points]
    detections = Detections(
        times=(times[0] if len(times) else 0.0) + np.arange(n_frames) / rate,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        points=np.concatenate([np.empty((0, 3)), *points]),
    )
    given: list[str] = list(header.get("names") or ())
    joined, track_names = _joined(
        detections, np.concatenate([np.empty(0, np.int64), *labels]), names, given
    )
    return Tracks(detections=detections, labels=joined, names=track_names)


def _joined(
    detections: Detections,
    labels: NDArray[np.int64],
    names: dict[int, str],
    given: list[str],
) -> tuple[NDArray[np.int64], tuple[str | None, ...]]:
    """Give the tracks numbers: first those of the marker set, then others as they appear."""
    found: dict[str | int, int] = {name: k for k, name in enumerate(given)}
    known, first, index = np.unique(labels, return_index=True, return_inverse=True)
    number = np.full(len(known), -1, dtype=np.int64)
    for i in np.argsort(first):
        label = int(known[i])
        if label >= 0:
            number[i] = found.setdefault(names.get(label, label), len(found))
    result = number[index]
    for i in _repeated(detections.frame_of, result):
        # The name is of another track in this frame.
        result[i] = found.setdefault(int(labels[i]), len(found))
    result[_repeated(detections.frame_of, result)] = -1
    return result, tuple(key if isinstance(key, str) else None for key in found)


def _repeated(frames: NDArray[np.int64], tracks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the points whose track has another point before them in the same frame."""
    order = np.lexsort((np.arange(len(tracks)), tracks, frames))
    same = (frames[order][1:] == frames[order][:-1]) & (tracks[order][1:] == tracks[order][:-1])
    return order[1:][same & (tracks[order][1:] >= 0)]
