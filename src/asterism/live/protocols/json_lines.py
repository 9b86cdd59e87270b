"""Frames as JSON lines: one object a frame, for home-made systems.

A line that comes in has ``frame`` (whole number), ``time`` (seconds) and ``points`` (a list of
three coordinates each, metres; null for a missing one). A line that goes out has ``labels``,
``names`` and ``tracks`` as well. ``tracks`` holds columns with one entry for each track.
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
    try:
        places = np.array(rows or np.zeros((0, 3)))
    except ValueError:
        raise PacketError("a point without three coordinates") from None
    if places.ndim != 2 or places.shape[1] != 3:
        raise PacketError("a point without three coordinates")
    if places.dtype.kind not in "iuf":
        raise PacketError("a coordinate that is no number")
    places = places.astype(np.float64, copy=False)
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
        "labels": np.ascontiguousarray(frame.labels),
    }
    if frame.names is not None:
        record["names"] = frame.names
    if frame.tracks is not None:
        record["tracks"] = _tracks(frame.tracks)
    return orjson.dumps(record, option=orjson.OPT_APPEND_NEWLINE | orjson.OPT_SERIALIZE_NUMPY)


def _tracks(states: TrackStates) -> dict[str, Any]:
    """Return the states as columns, one entry for each track."""
    columns: dict[str, Any] = {
        "id": np.ascontiguousarray(states.ids),
        "name": states.names,
        "position": _places(states.positions),
        "seen": states.is_seen,
    }
    if (velocities := states.velocities) is not None:
        columns["velocity"] = _places(velocities)
    if (existence := states.existence) is not None:
        columns["existence"] = existence  # null for NaN
    return columns


def _places(places: NDArray[np.float64]) -> Any:
    """Return coordinates as JSON holds them: null for a row that is not finite."""
    flat = np.ascontiguousarray(places)
    line = flat.reshape(-1)
    if math.isfinite(line.dot(line)):  # faster than to look at each
        return flat
    return [row if all(map(math.isfinite, row)) else None for row in places.tolist()]
