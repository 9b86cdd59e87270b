"""What the servers of all protocols share: an address, names, and the wait for a client."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from asterism.live.servers.listening import check_host

if TYPE_CHECKING:
    from asterism.live.servers.served_frame import ServedFrame

__all__ = ["Server"]


class Server(ABC):
    """Server of frames.

    Parameters
    ----------
    host, port : str and int
        Interface and port.
    names : tuple of str
        Names of the markers.
    rate : float
        Frame rate that clients are shown, Hz.

    Attributes
    ----------
    faults : dict of str to int
        Number of frames that clients missed, by reason.
    """

    def __init__(self, host: str, port: int, names: tuple[str, ...], rate: float) -> None:
        self.host, self.port = check_host(host), port
        self.names, self.rate = names, rate
        self.faults: dict[str, int] = {}
        self._asked = threading.Event()  # a client has asked for frames

    def __repr__(self) -> str:
        n, k = len(self.names), self.n_clients
        return f"{type(self).__name__}({self.host}:{self.port}, {n} markers, {k} clients)"

    @property
    @abstractmethod
    def n_clients(self) -> int:
        """Number of clients."""

    @abstractmethod
    def start(self) -> None:
        """Listen."""

    def wait_for_client(self, timeout: float) -> bool:
        """Wait until a client has asked for frames; return whether one has."""
        return self._asked.wait(timeout)

    @abstractmethod
    def rename(self, names: tuple[str, ...]) -> None:
        """Change the names of the markers."""

    @abstractmethod
    def send(self, frame: ServedFrame) -> None:
        """Send a frame to all clients."""

    @abstractmethod
    def finish(self) -> None:
        """Report the end to all clients."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect all clients and stop listening."""

    def _count(self, reason: str) -> None:
        self.faults[reason] = self.faults.get(reason, 0) + 1
