"""Frames for servers, and a plain client of the Qualisys protocol."""

from __future__ import annotations

import contextlib
import socket
import time

import numpy as np

from asterism.live import NatNetServer, QtmServer, ServedFrame
from asterism.live.protocols import qtm
from asterism.live.protocols.qtm import Packet

NAMES = tuple(f"M{i:02d}" for i in range(60))


def served_frames(n, seed=1, rate=240.0):
    """Frames with 60 markers, one of which is missing, and five other points."""
    rng = np.random.default_rng(seed)
    for t in range(n):
        markers = rng.normal(size=(60, 3))
        markers[t % 60] = np.nan
        yield ServedFrame(
            number=t + 1,
            time=t / rate,
            markers=markers,
            points=rng.normal(size=(5, 3)),
            ids=rng.integers(1, 2**16, 5),
        )


@contextlib.contextmanager
def qtm_server(**options):
    """A server on free ports."""
    server = QtmServer(**{"port": 0, "discovery_port": 0, "names": NAMES, "rate": 240.0} | options)
    server.start()
    try:
        yield server
    finally:
        server.close()


@contextlib.contextmanager
def natnet_server(**options):
    """A server on a free port."""
    server = NatNetServer(**{"port": 0, "names": NAMES, "rate": 240.0} | options)
    server.start()
    try:
        yield server
    finally:
        server.close()


class Client:
    """A client of the Qualisys protocol that does nothing by itself."""

    def __init__(self, port, order="<"):
        self.socket = socket.create_connection(("127.0.0.1", port), 5)
        self.order, self._buffer = order, bytearray()
        assert self.next() == (Packet.COMMAND, b"QTM RT Interface connected\0")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, command):
        self.socket.sendall(qtm.encode_text(Packet.COMMAND, command, self.order))

    def next(self, timeout=5):
        """Return kind and body of the next packet; None at the end of the connection."""
        self.socket.settimeout(timeout)
        while (found := qtm.split(self._buffer, self.order)) is None:
            received = self.socket.recv(65536)
            if not received:
                return None
            self._buffer += received
        kind, view = found
        body = bytes(view)
        view.release()
        del self._buffer[: len(body) + 8]
        return kind, body

    def ask(self, command):
        """Return kind and text of the answer to a command."""
        self.send(command)
        kind, body = self.next()
        return kind, qtm.text_of(body)


def until(condition, seconds=5.0):
    """Wait for a condition."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it has not happened in time"
        time.sleep(0.002)
