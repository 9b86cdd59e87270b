"""Sources of JSON lines: datagrams of home-made systems, and standard input."""

from __future__ import annotations

import queue
import socket
import sys
import threading
import time
from typing import TYPE_CHECKING

from asterism.checks import check_extra
from asterism.errors import SourceError, SourceLost
from asterism.live.faults import Faults
from asterism.live.frame import SourceFrame
from asterism.live.protocols.json_lines import LONGEST, decode_line
from asterism.live.protocols.packet_error import PacketError
from asterism.live.sources.base import EndOfSource

if TYPE_CHECKING:
    from typing import BinaryIO

__all__ = ["StandardInput", "UdpSource"]

_READ = 65_536
_QUEUE = 1024  # lines


class UdpSource:
    """Source of JSON lines in datagrams, one or several lines each.

    Parameters
    ----------
    name : str
        The source, as the user wrote it.
    host, port : str and int
        Address on which to listen.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        check_extra(name, "live", "orjson")
        self.name, self._address = name, (host, port)
        self.rate = 0.0
        self.waits = False
        self._faults = Faults(name)
        self.faults: dict[str, int] = self._faults.counts
        self._socket: socket.socket | None = None
        self._lines: list[tuple[bytes, float]] = []

    @property
    def port(self) -> int:
        """Port on which the source listens, once it is open."""
        return self._address[1] if self._socket is None else self._socket.getsockname()[1]

    def open(self) -> None:
        """Listen.

        Raises
        ------
        SourceError
            If the port is in use.
        """
        self.close()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**20)
            self._socket.bind(self._address)
        except OSError as error:
            self.close()
            text = (error.strerror or str(error)).lower()
            hint = "Choose another port, or an address of this machine"
            raise SourceError(f"{self.name}: cannot listen: {text}. {hint}.") from error

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        SourceLost
            If the source is not open.
        """
        if self._socket is None:
            raise SourceLost("the source is not open.")
        end = time.monotonic() + timeout
        while True:
            while self._lines:
                line, arrived = self._lines.pop(0)
                if (frame := decoded(line, arrived, self._faults)) is not None:
                    return frame
            self._socket.settimeout(max(0.0, end - time.monotonic()))
            try:
                packet = self._socket.recv(_READ)
            except OSError:  # in time there was none
                return None
            arrived = time.perf_counter()
            self._lines = [(line, arrived) for line in packet.splitlines() if line.strip()]

    def close(self) -> None:
        """Stop listening."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class StandardInput:
    """Source of JSON lines on standard input.

    Parameters
    ----------
    stream : binary file, optional
        File to read instead.
    """

    def __init__(self, stream: BinaryIO | None = None) -> None:
        check_extra("JSON lines", "live", "orjson")
        self.name = "-"
        self.rate = 0.0
        self.waits = True  # as a pipe does
        self._faults = Faults(self.name)
        self.faults: dict[str, int] = self._faults.counts
        self._stream = stream
        self._lines: queue.Queue[tuple[bytes, float] | None] = queue.Queue(_QUEUE)
        self._thread: threading.Thread | None = None
        self._is_over = False

    def open(self) -> None:
        """Begin to read."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._read, name="standard-input", daemon=True)
            self._thread.start()

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        EndOfSource
            At the end of the input.
        """
        end = time.monotonic() + timeout
        while not self._is_over:
            try:
                item = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                return None
            if item is None:
                self._is_over = True
            elif (frame := decoded(*item, self._faults)) is not None:
                return frame
        raise EndOfSource(self.name)

    def close(self) -> None:
        """Read no more; the thread ends with the input or with the process."""
        self._is_over = True

    def _read(self) -> None:
        stream = sys.stdin.buffer if self._stream is None else self._stream
        # A line that is longer than allowed arrives in parts, none of which is JSON.
        while line := stream.readline(LONGEST + 1):
            if line.strip():
                self._lines.put((line, time.perf_counter()))
        self._lines.put(None)


def decoded(line: bytes, arrived: float, faults: Faults) -> SourceFrame | None:
    """Return the frame of a line; a line that is none is counted."""
    try:
        number, seconds, points = decode_line(line)
    except PacketError as error:
        faults.undecoded(error)
        return None
    return SourceFrame(
        number=number, time=seconds, points=points, received=arrived, covariances=None
    )
