"""Packets of the Qualisys real-time protocol, versions 1.12 to 1.28.

A packet is its size and kind (two unsigned 32-bit integers) and a body. A data packet holds
components (`qtm_components`), each again with size and kind. `order` is ``"<"`` (little endian) or
``">"``.
The protocol is documented by Qualisys ("QTM RT Server Protocol Documentation").
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = [
    "LONGEST",
    "DataPacket",
    "Event",
    "Packet",
    "decode_data",
    "decode_discovery",
    "discovery",
    "encode_data",
    "encode_discovered",
    "encode_empty",
    "encode_event",
    "encode_text",
    "split",
    "text_of",
]

LONGEST = 4 * 2**20
"""Largest size of a packet that is accepted, bytes; a larger one is a lost boundary of packets."""
_HEADER = 8


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


def encode_empty(kind: Packet, order: str = "<") -> bytes:
    """Make a packet without a body."""
    return struct.pack(f"{order}II", _HEADER, kind)


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
