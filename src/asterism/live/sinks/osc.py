"""Sink that sends Open Sound Control messages over UDP, one bundle a frame.

``/asterism/frame`` has the frame number (int) and the time in seconds (double), and each point with
a track ``/asterism/marker/NAME`` or, without a name, ``/asterism/track/ID`` with x, y and z in
metres (floats).
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

import numpy as np

from asterism.live.sinks.datagrams import DatagramSink

if TYPE_CHECKING:
    from asterism.live.frame import LiveFrame

__all__ = ["OscSink"]

_BUNDLE = b"#bundle\0" + struct.pack(">Q", 1)  # the time that stands for "at once"
_LONGEST = 60_000  # bytes of a bundle; a larger frame is sent as several
_MAX_HEADS = 10_000


class OscSink(DatagramSink):
    """Sink of Open Sound Control messages.

    Parameters
    ----------
    name : str
        The sink, as the user wrote it.
    host, port : str and int
        Receiver.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        super().__init__(name, host, port)
        self._heads: dict[str | int, bytes] = {}

    def send(self, frame: LiveFrame) -> None:
        """Send a frame."""
        number = (frame.number + 2**31) % 2**32 - 2**31
        first = _padded("/asterism/frame") + _padded(",id") + struct.pack(">id", number, frame.time)
        parts, size = [_BUNDLE, _sized(first)], 0
        rows = np.flatnonzero(frame.labels >= 0)
        places = frame.points[rows].astype(">f4").tobytes()
        for i, row in enumerate(rows.tolist()):
            name = frame.names[row] if frame.names is not None else None
            head = self._head(int(frame.labels[row]) if name is None else name)
            parts.append(head + places[12 * i : 12 * i + 12])
            size += len(parts[-1])
            if size > _LONGEST:
                self._send(b"".join(parts))
                parts, size = [_BUNDLE], 0
        if len(parts) > 1:
            self._send(b"".join(parts))

    def _head(self, of: str | int) -> bytes:
        """Return size, address and types of the message of a marker or of a track."""
        if of not in self._heads:
            if len(self._heads) >= _MAX_HEADS:
                self._heads.clear()  # tracks come and go without end
            kind, text = ("track", str(of)) if isinstance(of, int) else ("marker", of)
            # These characters have a meaning in addresses.
            text = re.sub(r"[\s#*,/?\[\]{}]|[^ -~]", "_", text)
            head = _padded(f"/asterism/{kind}/{text}") + _padded(",fff")
            self._heads[of] = struct.pack(">i", len(head) + 12) + head
        return self._heads[of]


def _padded(text: str) -> bytes:
    """Return a text with one to four null characters, a multiple of four bytes."""
    return text.encode() + bytes(4 - len(text.encode()) % 4)


def _sized(message: bytes) -> bytes:
    return struct.pack(">i", len(message)) + message
