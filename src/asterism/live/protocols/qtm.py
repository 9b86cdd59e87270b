"""Packets of the Qualisys real-time protocol, versions 1.12 to 1.28.

A packet is its size and kind (two unsigned 32-bit integers) and a body. A data packet holds
components, each again with size and kind. Positions are in millimetres. The layout of the
components here is the same in all of these versions. `order` is ``"<"`` (little endian) or ``">"``.
The protocol is documented by Qualisys ("QTM RT Server Protocol Documentation").
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "COMPONENTS",
    "LONGEST",
    "Component",
    "DataPacket",
    "Event",
    "Packet",
    "decode_2d",
    "decode_data",
    "decode_discovery",
    "decode_markers",
    "decode_points",
    "discovery",
    "encode_data",
    "encode_discovered",
    "encode_empty",
    "encode_event",
    "encode_markers",
    "encode_points",
    "encode_text",
    "split",
    "text_of",
]

LONGEST = 4 * 2**20
"""Largest size of a packet that is accepted, bytes; a larger one is a lost boundary of packets."""
_HEADER = 8
_MM = 1000.0  # per metre


class Packet(IntEnum):
    """Kinds of packet."""

    ERROR = 0
    COMMAND = 1
    XML = 2
    DATA = 3
    NO_MORE_DATA = 4
    C3D_FILE = 5
    EVENT = 6
    DISCOVER = 7
    QTM_FILE = 8


class Event(IntEnum):
    """Kinds of event, of which each is also a state."""

    CONNECTED = 1
    CONNECTION_CLOSED = 2
    CAPTURE_STARTED = 3
    CAPTURE_STOPPED = 4
    RT_FROM_FILE_STARTED = 8
    RT_FROM_FILE_STOPPED = 9
    CAMERA_SETTINGS_CHANGED = 11
    SHUTTING_DOWN = 12


class Component(IntEnum):
    """Kinds of component of a data packet."""

    MARKERS = 1
    POINTS = 2
    ANALOG = 3
    FORCE = 4
    BODIES = 5
    BODIES_EULER = 6
    IMAGE_POINTS = 7
    IMAGE_POINTS_LINEAR = 8
    MARKERS_RESIDUAL = 9
    POINTS_RESIDUAL = 10
    BODIES_RESIDUAL = 11
    BODIES_EULER_RESIDUAL = 12
    ANALOG_SINGLE = 13
    IMAGE = 14
    FORCE_SINGLE = 15
    GAZE = 16
    TIMECODE = 17
    SKELETON = 18
    EYE_TRACKER = 19


COMPONENTS = {
    "3d": Component.MARKERS,
    "3dnolabels": Component.POINTS,
    "analog": Component.ANALOG,
    "force": Component.FORCE,
    "6d": Component.BODIES,
    "6deuler": Component.BODIES_EULER,
    "2d": Component.IMAGE_POINTS,
    "2dlin": Component.IMAGE_POINTS_LINEAR,
    "3dres": Component.MARKERS_RESIDUAL,
    "3dnolabelsres": Component.POINTS_RESIDUAL,
    "6dres": Component.BODIES_RESIDUAL,
    "6deulerres": Component.BODIES_EULER_RESIDUAL,
    "analogsingle": Component.ANALOG_SINGLE,
    "image": Component.IMAGE,
    "forcesingle": Component.FORCE_SINGLE,
    "gazevector": Component.GAZE,
    "timecode": Component.TIMECODE,
    "skeleton": Component.SKELETON,
    "eyetracker": Component.EYE_TRACKER,
}
"""Component of each lower-case name that clients use in commands."""
_WITH_RATES = {c for name, c in COMPONENTS.items() if name[0].isdigit()}  # 2D, 3D and 6D
_ROWS = {
    (order, kind): np.dtype([("place", f"{order}f4", 3), *more])
    for order in "<>"
    for kind, more in {
        Component.MARKERS: (),
        Component.MARKERS_RESIDUAL: (("residual", f"{order}f4"),),
        Component.POINTS: (("id", f"{order}u4"),),
        Component.POINTS_RESIDUAL: (("id", f"{order}u4"), ("residual", f"{order}f4")),
    }.items()
}
_IMAGE_ROW = {
    order: np.dtype([("x", f"{order}i4"), ("y", f"{order}i4"), ("size", f"{order}i2", 2)])
    for order in "<>"
}


class DataPacket(NamedTuple):
    """Content of a data packet.

    Attributes
    ----------
    time : float
        Seconds since the start of the measurement.
    number : int
        Frame number.
    components : dict of int to memoryview
        Body of each component by its kind.
    """

    time: float
    number: int
    components: dict[int, memoryview]


def encode_text(kind: Packet, text: str, order: str = "<") -> bytes:
    """Make a packet that holds a text: a command, an answer, an error or XML.

    Examples
    --------
    >>> encode_text(Packet.COMMAND, "version 1.25").hex(" ", -4)
    '15000000 01000000 76657273 696f6e20 312e3235 00'
    """
    body = text.encode() + b"\0"
    return struct.pack(f"{order}II", _HEADER + len(body), kind) + body


def encode_event(event: Event, order: str = "<") -> bytes:
    """Make a packet that reports an event."""
    return struct.pack(f"{order}IIB", _HEADER + 1, Packet.EVENT, event)


def encode_empty(kind: Packet | Component, order: str = "<") -> bytes:
    """Make a packet without a body, or a component that lists nothing."""
    if isinstance(kind, Packet):
        return struct.pack(f"{order}II", _HEADER, kind)
    if kind in _WITH_RATES:
        return struct.pack(f"{order}IIIHH", _HEADER + 8, kind, 0, 0, 0)
    return struct.pack(f"{order}III", _HEADER + 4, kind, 0)


def encode_data(time: float, number: int, components: Sequence[bytes], order: str = "<") -> bytes:
    """Make a data packet of components.

    Parameters
    ----------
    time : float
        Seconds since the start.
    number : int
        Frame number; its lowest 32 bits are sent.
    components : sequence of bytes
        Components in the order of the packet.
    order : str
        Byte order.
    """
    body = b"".join(components)
    head = struct.pack(
        f"{order}IIqII", _HEADER + 16 + len(body), Packet.DATA, round(time * 1e6),
        number & 0xFFFFFFFF, len(components),
    )  # fmt: skip
    return head + body


def encode_markers(
    markers: NDArray[np.float64], *, residuals: bool = False, order: str = "<"
) -> bytes:
    """Make the component of labelled markers.

    Parameters
    ----------
    markers : ndarray of shape (K, 3)
        Positions in the order of the labels, metres; NaN for a missing marker.
    residuals : bool
        Whether each marker has a residual, which is written as 0.
    order : str
        Byte order.
    """
    kind = Component.MARKERS_RESIDUAL if residuals else Component.MARKERS
    rows = np.zeros(len(markers), _ROWS[order, kind])
    rows["place"] = markers * _MM
    missing = np.isnan(markers).any(axis=1)
    if missing.any():
        # Clients test a missing marker by all 32 bits, which is one of many patterns of NaN.
        rows.view(f"{order}u4").reshape(len(rows), -1)[missing, :3] = 0xFFFFFFFF
    return _component(kind, rows, order)


def encode_points(
    points: NDArray[np.float64],
    ids: NDArray[np.int64],
    *,
    residuals: bool = False,
    order: str = "<",
) -> bytes:
    """Make the component of unlabelled points.

    Parameters
    ----------
    points : ndarray of shape (N, 3)
        Positions, metres.
    ids : ndarray of int, shape (N,)
        Number of each point, of which the lowest 32 bits are sent.
    residuals : bool
        Whether each point has a residual, which is written as 0.
    order : str
        Byte order.
    """
    kind = Component.POINTS_RESIDUAL if residuals else Component.POINTS
    rows = np.zeros(len(points), _ROWS[order, kind])
    rows["place"] = points * _MM
    rows["id"] = ids & 0xFFFFFFFF
    return _component(kind, rows, order)


def _component(kind: Component, rows: NDArray[np.void], order: str) -> bytes:
    size = _HEADER + 8 + rows.nbytes
    return struct.pack(f"{order}IIIHH", size, kind, len(rows), 0, 0) + rows.tobytes()


def split(buffer: bytearray, order: str = "<") -> tuple[int, memoryview] | None:
    """Return kind and body of the first packet of a buffer; None if it is not complete.

    The caller removes ``len(body) + 8`` bytes, after the release of the body.

    Raises
    ------
    PacketError
        If size or kind is impossible, so that the boundary of packets is lost.
    """
    if len(buffer) < _HEADER:
        return None
    size, kind = struct.unpack_from(f"{order}II", buffer)
    if not _HEADER <= size <= LONGEST:
        raise PacketError(f"a packet of {size} bytes")
    if kind > max(Packet):
        raise PacketError(f"a packet of kind {kind}")
    if len(buffer) < size:
        return None
    return kind, memoryview(buffer)[_HEADER:size]


def text_of(body: bytes | memoryview) -> str:
    """Return the text of a packet, without the null character at its end."""
    return bytes(body).split(b"\0", 1)[0].decode("utf-8", errors="replace")


def decode_data(body: bytes | memoryview, order: str = "<") -> DataPacket:
    """Take a data packet apart.

    Parameters
    ----------
    body : bytes
        Packet without its header.
    order : str
        Byte order.

    Raises
    ------
    PacketError
        If the packet is truncated or a component does not fit into it.
    """
    body = memoryview(body)
    if len(body) < 16:
        raise PacketError("a data packet without a whole header")
    time, number, n = struct.unpack_from(f"{order}qII", body)
    components: dict[int, memoryview] = {}
    at = 16
    for _ in range(n):
        if len(body) < at + _HEADER:
            raise PacketError("a data packet with fewer components than it states")
        size, kind = struct.unpack_from(f"{order}II", body, at)
        if size < _HEADER or at + size > len(body):
            raise PacketError(f"a component of {size} bytes")
        components[kind] = body[at + _HEADER : at + size]
        at += size
    return DataPacket(time / 1e6, number, components)


def decode_markers(
    body: bytes | memoryview, *, residuals: bool = False, order: str = "<"
) -> NDArray[np.float64]:
    """Return the labelled markers of a component, shape (K, 3), metres; NaN if missing.

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    kind = Component.MARKERS_RESIDUAL if residuals else Component.MARKERS
    return _rows(body, kind, order)["place"].astype(np.float64) / _MM


def decode_points(
    body: bytes | memoryview, *, residuals: bool = False, order: str = "<"
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the unlabelled points of a component, shape (N, 3), metres, and their ids, (N,).

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    kind = Component.POINTS_RESIDUAL if residuals else Component.POINTS
    rows = _rows(body, kind, order)
    return rows["place"].astype(np.float64) / _MM, rows["id"].astype(np.int64)


def _rows(body: bytes | memoryview, kind: Component, order: str) -> NDArray[np.void]:
    if len(body) < 8:
        raise PacketError("a component without a whole header")
    (n,) = struct.unpack_from(f"{order}I", body)
    dtype = _ROWS[order, kind]
    if n * dtype.itemsize > len(body) - 8:
        raise PacketError(f"a component of {n} markers in {len(body)} bytes")
    return np.frombuffer(body, dtype, count=n, offset=8)


def decode_2d(body: bytes | memoryview, order: str = "<") -> list[NDArray[np.float64]]:
    """Return the image points of each camera of a component, in units of 1/64 pixel.

    Returns
    -------
    list of ndarray, each of shape (n, 2)

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    if len(body) < 8:
        raise PacketError("a component without a whole header")
    (n_cameras,) = struct.unpack_from(f"{order}I", body)
    dtype, at = _IMAGE_ROW[order], 8
    cameras: list[NDArray[np.float64]] = []
    for _ in range(n_cameras):
        if len(body) < at + 5:
            raise PacketError("a component with fewer cameras than it states")
        (n,) = struct.unpack_from(f"{order}I", body, at)
        at += 5  # the count and the flags of the camera
        if n * dtype.itemsize > len(body) - at:
            raise PacketError(f"{n} image points in {len(body)} bytes")
        rows = np.frombuffer(body, dtype, count=n, offset=at)
        cameras.append(np.column_stack([rows["x"], rows["y"]]).astype(np.float64))
        at += n * dtype.itemsize
    return cameras


def discovery(port: int) -> bytes:
    """Make the packet by which a client searches servers; they answer to its UDP port."""
    return struct.pack("<II", 10, Packet.DISCOVER) + struct.pack(">H", port)


def decode_discovery(packet: bytes) -> int:
    """Return the UDP port to which a client wants the answer.

    Raises
    ------
    PacketError
        If it is no packet of discovery.
    """
    if len(packet) < 10 or struct.unpack_from("<II", packet)[1] != Packet.DISCOVER:
        raise PacketError("no packet of discovery")
    (port,) = struct.unpack_from(">H", packet, 8)
    if not port:
        raise PacketError("a packet of discovery without a port")
    return port


def encode_discovered(about: str, base_port: int) -> bytes:
    """Make the answer to a discovery.

    Parameters
    ----------
    about : str
        Name, version and number of cameras of the server.
    base_port : int
        Port of the server from which all others count; the little-endian port is the next.
    """
    body = about.encode() + b"\0" + struct.pack(">H", base_port)
    return struct.pack("<II", _HEADER + len(body), Packet.COMMAND) + body
