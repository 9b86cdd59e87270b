"""Packets of OptiTrack's NatNet protocol, versions 3.0 to 4.1: frames of data.

A packet is a message number and the size of its body (two unsigned 16-bit integers, little endian)
and the body. Positions are in metres. `asterism.live.protocols.natnet_messages` has the messages
other than frames. The layout follows the depacketiser that OptiTrack publishes with its SDK.
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
    "HAS_MODEL",
    "OCCLUDED",
    "SOLVED",
    "UNLABELLED",
    "VERSIONS",
    "FrameOfData",
    "Message",
    "Reader",
    "decode_frame",
    "decode_message",
    "encode_frame",
    "encode_message",
    "text_bytes",
]

VERSIONS = ((3, 0), (3, 1), (4, 0), (4, 1))
"""Versions of the bit stream that are spoken."""
OCCLUDED, SOLVED, HAS_MODEL, UNLABELLED = 0x01, 0x02, 0x08, 0x10
"""Flags of a labelled marker."""
_MARKER_SIZE = 0.014  # diameter, metres
_LARGEST_BODY = 65_507 - 4

_LABELLED = np.dtype(
    [("id", "<u4"), ("place", "<f4", 3), ("size", "<f4"), ("flags", "<u2"), ("residual", "<f4")]
)
_WITHOUT_LABEL = np.array((0, (0, 0, 0), _MARKER_SIZE, SOLVED | UNLABELLED, 0), _LABELLED)
_NONE = np.empty(0, dtype=np.intp)
_BODY = np.dtype(
    [("id", "<i4"), ("place", "<f4", 3), ("rotation", "<f4", 4), ("error", "<f4"), ("flags", "<u2")]
)


class Message(IntEnum):
    """Kinds of message."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODEL = 4
    MODEL = 5
    REQUEST_FRAME = 6
    FRAME = 7
    TEXT = 8
    DISCONNECT = 9
    KEEP_ALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    DISCOVERY = 14
    UNRECOGNIZED = 100


class FrameOfData(NamedTuple):
    """Content of a frame.

    Attributes
    ----------
    number : int
        Frame number.
    time : float
        Seconds by the clock of the server.
    marker_sets : dict of str to ndarray of shape (K, 3)
        Positions by marker set, in the order of its names, metres.
    others : ndarray of shape (N, 3)
        Points of no marker set, metres.
    bodies : ndarray of records
        Rigid bodies: ``id``, ``place``, ``rotation`` (x, y, z, w), ``error`` and ``flags``.
    n_skeletons, n_force_plates, n_devices : int
        Numbers of the parts that are skipped.
    labelled : ndarray of records
        Labelled markers, which include points without a label: ``id`` (upper 16 bits: the model;
        lower 16 bits: the marker), ``place``, ``size`` (diameter, metres), ``flags`` (sum of
        `OCCLUDED`, `SOLVED`, `HAS_MODEL`, `UNLABELLED` and others) and ``residual`` (mean distance
        between the marker and its rays, metres).
    exposed, received, sent : int
        High-resolution times of the server's clock: middle of the exposure, arrival of the data of
        the cameras, and transmission.
    """

    number: int
    time: float
    marker_sets: dict[str, NDArray[np.float32]]
    others: NDArray[np.float32]
    bodies: NDArray[np.void]
    n_skeletons: int
    labelled: NDArray[np.void]
    n_force_plates: int
    n_devices: int
    exposed: int
    received: int
    sent: int


class Reader:
    """Reads from the front of a body; every step is checked against its end.

    Parameters
    ----------
    body : bytes
        The body.
    """

    def __init__(self, body: bytes | memoryview) -> None:
        self._body, self._at = memoryview(body), 0

    @property
    def n_left(self) -> int:
        """Number of bytes that are not read yet."""
        return len(self._body) - self._at

    def values(self, layout: str) -> tuple[float, ...]:
        """Read numbers of a layout of `struct`."""
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def count(self) -> int:
        """Read a number of things, which cannot be more than there are bytes."""
        (n,) = struct.unpack("<I", self.take(4))
        if n > self.n_left:
            raise PacketError(f"{n} items in {self.n_left} bytes")
        return n

    def rows(self, n: int, dtype: np.dtype[np.void]) -> NDArray[np.void]:
        """Read an array."""
        return np.frombuffer(self.take(n * dtype.itemsize), dtype, count=n)

    def text(self) -> str:
        """Read a text that ends with a null character."""
        rest = bytes(self._body[self._at : self._at + 1024])
        end = rest.find(b"\0")
        if end < 0:
            raise PacketError("a text without an end")
        self._at += end + 1
        return rest[:end].decode("utf-8", errors="replace")

    def take(self, n: int) -> memoryview:
        """Read bytes."""
        begin, end = self._at, self._at + n
        if end > len(self._body):
            raise PacketError(f"{n} bytes where {self.n_left} are left")
        self._at = end
        return self._body[begin:end]


def text_bytes(text: str) -> bytes:
    """Return a text with a null character at its end."""
    return text.replace("\0", "").encode() + b"\0"


def encode_message(kind: Message, body: bytes = b"") -> bytes:
    r"""Make a packet.

    Raises
    ------
    PacketError
        If the body does not fit into a datagram.

    Examples
    --------
    >>> encode_message(Message.REQUEST, b"FrameRate\0").hex(" ", -2)
    '0200 0a00 4672 616d 6552 6174 6500'
    """
    if len(body) > _LARGEST_BODY:
        raise PacketError(f"a body of {len(body)} bytes, which no datagram holds")
    return struct.pack("<HH", kind, len(body)) + body


def decode_message(packet: bytes) -> tuple[int, memoryview]:
    """Return message number and body of a packet.

    Raises
    ------
    PacketError
        If the packet is truncated. Bytes beyond the stated size are ignored, because some clients
        add a null character.
    """
    if len(packet) < 4:
        raise PacketError("a packet without a whole header")
    kind, size = struct.unpack_from("<HH", packet)
    if size > len(packet) - 4:
        raise PacketError(f"a body of {size} bytes in {len(packet) - 4}")
    return kind, memoryview(packet)[4 : 4 + size]


def encode_frame(
    version: tuple[int, int],
    number: int,
    time: float,
    *,
    marker_set: str,
    markers: NDArray[np.float64],
    points: NDArray[np.float64],
    ids: NDArray[np.int64],
    ticks: tuple[int, int, int] = (0, 0, 0),
) -> bytes:
    """Make the packet of a frame with one marker set and points without a label.

    Parameters
    ----------
    version : tuple of int
        One of `VERSIONS`.
    number : int
        Frame number; its lowest 32 bits are sent.
    time : float
        Seconds.
    marker_set : str
        Name of the marker set.
    markers : ndarray of shape (K, 3)
        Its markers, metres; NaN for a missing one, which is left out of the labelled markers.
    points : ndarray of shape (N, 3)
        Points without a label, metres.
    ids : ndarray of int, shape (N,)
        Their numbers, of which the lowest 16 bits are sent.
    ticks : tuple of int
        Times of exposure, of arrival, and of transmission by the server's high-resolution clock.

    Raises
    ------
    PacketError
        If the frame does not fit into a datagram.
    """
    is_sized = version >= (4, 1)
    seen = np.flatnonzero(np.isfinite(markers).all(axis=1)) if len(markers) else _NONE
    n_seen = len(seen)
    rows = np.full(n_seen + len(points), _WITHOUT_LABEL)
    rows["id"][n_seen:] = ids & 0xFFFF
    rows["place"][n_seen:] = points
    if n_seen:
        rows["id"][:n_seen] = (1 << 16) + 1 + seen
        rows["place"][:n_seen] = markers[seen]
        rows["flags"][:n_seen] = SOLVED | HAS_MODEL

    sets = [_set(marker_set, markers)] if len(markers) else []
    empty = _section([], is_sized)
    parts = [
        struct.pack("<I", number & 0xFFFFFFFF),
        _section(sets, is_sized),
        _section([points.astype("<f4").tobytes()], is_sized, len(points)),
        empty,  # rigid bodies
        empty,  # skeletons
        empty if is_sized else b"",  # assets
        _section([rows.tobytes()], is_sized, len(rows)),
        empty,  # force plates
        empty,  # devices
        struct.pack("<IIdQQQ", 0, 0, time, *ticks),
        # OptiTrack's own client reads the precise time in 4.0 too, where the manual lacks it.
        bytes(8) if version >= (4, 0) else b"",
        bytes(2 + 4),  # flags, and the end
    ]
    return encode_message(Message.FRAME, b"".join(parts))


def _set(name: str, markers: NDArray[np.float64]) -> bytes:
    return text_bytes(name) + struct.pack("<I", len(markers)) + markers.astype("<f4").tobytes()


def _section(items: Sequence[bytes], is_sized: bool, n: int | None = None) -> bytes:
    body = b"".join(items)
    size = struct.pack("<I", len(body)) if is_sized else b""
    return struct.pack("<I", len(items) if n is None else n) + size + body


def decode_frame(body: bytes | memoryview, version: tuple[int, int]) -> FrameOfData:
    """Take the body of a frame apart.

    Parameters
    ----------
    body : bytes
        Body of a message `Message.FRAME`.
    version : tuple of int
        Version of the bit stream.

    Raises
    ------
    PacketError
        If the body is truncated or inconsistent.
    """
    reader = Reader(body)
    is_sized = version >= (4, 1)

    def begin() -> int:
        n = reader.count()
        if is_sized:
            reader.take(4)
        return n

    (number,) = reader.values("<I")
    sets: dict[str, NDArray[np.float32]] = {}
    for _ in range(begin()):
        name = reader.text()
        sets[name] = _places(reader, reader.count())
    others = _places(reader, begin())
    bodies = reader.rows(begin(), _BODY)
    n_skeletons = begin()
    for _ in range(n_skeletons):
        reader.take(4)
        reader.rows(reader.count(), _BODY)
    if is_sized:
        for _ in range(begin()):
            reader.take(4)
            reader.rows(reader.count(), _BODY)
            reader.rows(reader.count(), _LABELLED)
    rows = reader.rows(begin(), _LABELLED)
    n_plates, n_devices = _skip_channels(reader, begin()), _skip_channels(reader, begin())
    _, _, time, exposed, received, sent = reader.values("<IIdQQQ")
    return FrameOfData(
        number=int(number),
        time=float(time),
        marker_sets=sets,
        others=others,
        bodies=bodies,
        n_skeletons=n_skeletons,
        labelled=rows,
        n_force_plates=n_plates,
        n_devices=n_devices,
        exposed=int(exposed),
        received=int(received),
        sent=int(sent),
    )


def _places(reader: Reader, n: int) -> NDArray[np.float32]:
    return np.frombuffer(reader.take(12 * n), "<f4").reshape(n, 3)


def _skip_channels(reader: Reader, n: int) -> int:
    """Skip force plates or devices, and return their number."""
    for _ in range(n):
        reader.take(4)
        for _ in range(reader.count()):
            reader.take(4 * reader.count())  # values, four bytes each
    return n
