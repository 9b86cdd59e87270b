"""Frames as JSON lines: one object a frame, for home-made systems.

A line that comes in has ``frame`` (whole number), ``time`` (seconds) and ``points`` (a list of
three coordinates each, metres; null for a missing one). A line that goes out has ``labels``,
``names`` and ``tracks`` as well.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.live.frame import LiveFrame
    from asterism.tracking.methods.states import TrackStates

__all__ = ["LONGEST", "decode_line", "encode_line"]

LONGEST = 4 * 2**20
"""Longest line that is read, bytes."""


def decode_line(line: bytes) -> tuple[int, float, NDArray[np.float64]]:
    """Read a line.

    Parameters
    ----------
    line : bytes
        JSON object; further keys are ignored.

    Returns
    -------
    number : int
        Frame number.
    time : float
        Seconds.
    points : ndarray of shape (N, 3)
        Metres.

    Raises
    ------
    PacketError
        If the line is too long, no JSON, or a key is missing or wrong.

    Examples
    --------
    >>> decode_line(b'{"frame": 12, "time": 0.12, "points": [[0, 1, 2], null]}')
    (12, 0.12, array([[0., 1., 2.]]))
    """
    if len(line) > LONGEST:
        raise PacketError("a line that is too long")
    import orjson

    try:
        found = orjson.loads(line)
    except ValueError:
        raise PacketError("a line that is no JSON") from None
    if not isinstance(found, dict):
        raise PacketError("a line that is no JSON object")
    record = cast("dict[str, Any]", found)
    number, time = _number(record, "frame"), _number(record, "time")
    if not -(2**62) < number < 2**62 or int(number) != number:
        raise PacketError("a frame that is no whole number")
    points = record.get("points")
    if not isinstance(points, list):
        raise PacketError("points that are no list")
    rows = [row for row in cast("list[Any]", points) if row is not None]
    for row in rows:
        if not isinstance(row, list) or len(cast("list[Any]", row)) != 3:
            raise PacketError("a point without three coordinates")
        if not all(isinstance(x, (int, float)) for x in cast("list[Any]", row)):
            raise PacketError("a coordinate that is no number")
    try:
        places = np.array(rows, dtype=np.float64).reshape(-1, 3)
    except OverflowError:
        raise PacketError("a coordinate that is too large") from None
    return int(number), float(time), places


def _number(record: dict[str, Any], key: str) -> float:
    value = record.get(key)
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
        return value
    raise PacketError(f"a {key} that is no number")


def encode_line(frame: LiveFrame) -> bytes:
    r"""Write a frame as a line, with the line feed.

    Parameters
    ----------
    frame : LiveFrame
        The frame.

    Examples
    --------
    >>> from asterism.live.frame import LiveFrame
    >>> encode_line(LiveFrame(
    ...     number=12, time=0.12, points=np.zeros((1, 3)), labels=np.array([4]), names=("LASI",)))
    b'{"frame":12,"time":0.12,"points":[[0.0,0.0,0.0]],"labels":[4],"names":["LASI"]}\n'
    """
    import orjson

    record: dict[str, Any] = {
        "frame": int(frame.number),
        "time": float(frame.time),
        "points": _places(frame.points),
        "labels": frame.labels.tolist(),
    }
    if frame.names is not None:
        record["names"] = list(frame.names)
    if frame.tracks is not None:
        record["tracks"] = _tracks(frame.tracks)
    return orjson.dumps(record, option=orjson.OPT_APPEND_NEWLINE)


def _tracks(states: TrackStates) -> list[dict[str, Any]]:
    columns: dict[str, list[Any]] = {
        "id": states.ids.tolist(),
        "name": list(states.names),
        "position": _places(states.positions),
        "seen": states.is_seen.tolist(),
    }
    if states.velocities is not None:
        columns["velocity"] = _places(states.velocities)
    if states.existence is not None:
        columns["existence"] = [None if math.isnan(p) else p for p in states.existence.tolist()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _places(places: NDArray[np.float64]) -> list[Any]:
    """Return coordinates as lists, and null for what is not finite, which JSON cannot hold."""
    rows = places.tolist()
    if not np.isfinite(places).all():
        return [row if all(map(math.isfinite, row)) else None for row in rows]
    return rows
