"""Messages of NatNet beside frames: connection, server, model definitions, requests and echoes."""

from __future__ import annotations

import struct
from typing import NamedTuple

from asterism.live.protocols.natnet import (
    Message,
    Reader,
    encode_message,
    text_bytes,
)
from asterism.live.protocols.packet_error import PacketError

__all__ = [
    "ServerInfo",
    "decode_marker_sets",
    "decode_server_info",
    "encode_connect",
    "encode_echo",
    "encode_marker_set",
    "encode_server_info",
    "wanted_version",
]

_MARKER_SET, _RIGID_BODY = 0, 1  # kinds of model definition


class ServerInfo(NamedTuple):
    """What a server says about itself.

    Attributes
    ----------
    application : str
        Name of the program.
    version : tuple of int
        Version of the bit stream, major and minor.
    clock_rate : int
        Ticks of its high-resolution clock per second.
    data_port : int
        UDP port of the frames with multicast.
    multicast : str
        Multicast group; empty if frames go to each client by itself.
    """

    application: str
    version: tuple[int, int]
    clock_rate: int
    data_port: int
    multicast: str


def encode_connect(version: tuple[int, int], kind: Message = Message.CONNECT) -> bytes:
    """Make the message by which a client connects, or searches with `Message.DISCOVERY`.

    Parameters
    ----------
    version : tuple of int
        Version of the bit stream that the client wants.
    kind : Message
        The message.
    """
    sender = b"Asterism".ljust(256, b"\0") + bytes((0, 1, 0, 0, *version, 0, 0))
    return encode_message(kind, sender + bytes((0, *version, 0, 0)))


def wanted_version(body: bytes | memoryview) -> tuple[int, int] | None:
    """Return the version that a connecting client wants; None if it does not say.

    Clients of version 4 state it at the end, older ones their own version after their name.
    """
    for at in (265, 260):
        if len(body) >= at + 4 and body[at]:
            return body[at], body[at + 1]
    return None


def encode_server_info(info: ServerInfo) -> bytes:
    """Make the answer to a connection or a discovery."""
    name = info.application.encode()[:255].ljust(256, b"\0")
    group = bytes(map(int, (info.multicast or "0.0.0.0").split(".")))
    tail = struct.pack("<QH?", info.clock_rate, info.data_port, bool(info.multicast)) + group
    versions = bytes((3, 1, 0, 0, *info.version, 0, 0))
    return encode_message(Message.SERVER_INFO, name + versions + tail)


def decode_server_info(body: bytes | memoryview) -> ServerInfo:
    """Read what a server says about itself.

    Raises
    ------
    PacketError
        If the message is truncated.
    """
    reader = Reader(body)
    application = bytes(reader.take(256)).split(b"\0", 1)[0].decode("utf-8", errors="replace")
    reader.take(4)
    major, minor, _, _ = reader.take(4)
    if major < 3:
        return ServerInfo(application, (major, minor), 0, 0, "")
    rate, port, is_multicast = reader.values("<QHB")
    group = ".".join(map(str, reader.take(4)))
    return ServerInfo(
        application, (major, minor), int(rate), int(port), group if is_multicast else ""
    )


def encode_marker_set(name: str, markers: tuple[str, ...], version: tuple[int, int]) -> bytes:
    """Make the model definitions of one marker set, or of none without markers.

    Parameters
    ----------
    name : str
        Name of the marker set.
    markers : tuple of str
        Names of its markers.
    version : tuple of int
        Version of the bit stream.
    """
    if not markers:
        return encode_message(Message.MODEL, struct.pack("<I", 0))
    definition = text_bytes(name) + struct.pack("<I", len(markers))
    definition += b"".join(map(text_bytes, markers))
    size = struct.pack("<I", len(definition)) if version >= (4, 1) else b""
    head = struct.pack("<II", 1, _MARKER_SET)
    return encode_message(Message.MODEL, head + size + definition)


def decode_marker_sets(
    body: bytes | memoryview, version: tuple[int, int]
) -> dict[str, tuple[str, ...]]:
    """Return the marker sets among the model definitions: names of their markers.

    Definitions of other kinds are skipped. Where a version states no sizes, only marker sets and
    rigid bodies can be skipped, and reading ends at the first definition of another kind.

    Raises
    ------
    PacketError
        If the message is truncated.
    """
    reader = Reader(body)
    found: dict[str, tuple[str, ...]] = {}
    for _ in range(reader.count()):
        (kind,) = reader.values("<I")
        part = reader
        if version >= (4, 1):
            part = Reader(reader.take(reader.count()))
        if kind == _MARKER_SET:
            name = part.text()
            found[name] = tuple(part.text() for _ in range(part.count()))
        elif version < (4, 1):
            if kind != _RIGID_BODY:
                break
            _skip_body(part, version)
    return found


def _skip_body(reader: Reader, version: tuple[int, int]) -> None:
    reader.text()
    reader.take(4 + 4 + 12)  # its number, its parent's, the offset
    n = reader.count()
    reader.take((12 + 4) * n)
    if version >= (4, 0):
        for _ in range(n):
            reader.text()


def encode_echo(request: bytes | memoryview, ticks: int) -> bytes:
    """Make the answer by which a client compares its clock with that of the server.

    Parameters
    ----------
    request : bytes
        Body of the request: the time of the client.
    ticks : int
        Time of the server's high-resolution clock.

    Raises
    ------
    PacketError
        If the request is truncated.
    """
    if len(request) < 8:
        raise PacketError("an echo without a time")
    return encode_message(Message.ECHO_RESPONSE, bytes(request[:8]) + struct.pack("<Q", ticks))
