"""What sinks of datagrams share: a socket that never blocks, and the count of what it refuses."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

from asterism.errors import SinkError

if TYPE_CHECKING:
    from asterism.live.frame import StreamHeader

__all__ = ["DatagramSink"]


class DatagramSink:
    """Base of sinks that send UDP datagrams to one receiver.

    Parameters
    ----------
    name : str
        The sink, as the user wrote it.
    host, port : str and int
        Receiver.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name, self._target = name, (host, port)
        self.faults: dict[str, int] = {}
        self._socket: socket.socket | None = None

    def open(self, header: StreamHeader) -> None:
        """Open the socket.

        Raises
        ------
        SinkError
            If the host is unknown.
        """
        del header
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect(self._target)
        except OSError as error:
            self.close()
            raise SinkError(f"{self.name}: {error.strerror or error}. Check the host.") from error
        self._socket.setblocking(False)

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, packet: bytes) -> None:
        """Send a datagram; after `close` it is dropped."""
        if self._socket is None:
            return
        try:
            self._socket.send(packet)
        except OSError:
            self.faults["UDP not sent"] = self.faults.get("UDP not sent", 0) + 1
