"""Server that speaks OptiTrack's NatNet protocol, with unicast or multicast.

Frames are sent by the thread that has them; a thread of the server answers the messages of clients.
UDP has no connections: with unicast, a client is one that has connected and sent any message within
the last minute. A frame that a socket does not take at once is dropped for that client and counted.
"""

from __future__ import annotations

import math
import select
import socket
import struct
import threading
import time
from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.live.protocols.natnet import (
    VERSIONS,
    Message,
    decode_message,
    encode_frame,
    encode_message,
)
from asterism.live.protocols.natnet_messages import (
    ServerInfo,
    encode_echo,
    encode_marker_set,
    encode_server_info,
    wanted_version,
)
from asterism.live.protocols.packet_error import PacketError
from asterism.live.servers.base import Server
from asterism.live.servers.listening import check_host, udp_socket

if TYPE_CHECKING:
    from asterism.live.servers.served_frame import ServedFrame

__all__ = ["DATA_PORT", "GROUP", "PORT", "NatNetServer"]

PORT, DATA_PORT, GROUP = 1510, 1511, "239.255.42.99"
"""Usual port of commands, port of multicast frames, and multicast group."""
_CLOCK_RATE = 10_000_000  # ticks per second
_ALIVE_SECONDS = 60.0
_MAX_CLIENTS = 100


class NatNetServer(Server):
    """Server of frames for clients of Motive.

    Parameters
    ----------
    host : str
        Address of the interface; ``127.0.0.1`` serves this machine only.
    port : int
        UDP port of commands; 0 takes a free one.
    names : tuple of str
        Names of the markers of the marker set.
    marker_set : str
        Name of the marker set.
    rate : float
        Frame rate that clients are shown, Hz.
    version : tuple of int
        Newest version of the bit stream that clients get, one of (3, 0), (3, 1), (4, 0), (4, 1).
    multicast : str
        Multicast group, such as ``239.255.42.99``; empty for unicast.
    data_port : int
        Port of the frames with multicast.

    Attributes
    ----------
    faults : dict of str to int
        Number of frames that clients missed, by reason.

    Raises
    ------
    ParameterError
        If the version or the group is none.

    Examples
    --------
    >>> server = NatNetServer(port=0, names=("LASI", "RASI"), rate=240.0)
    >>> server.start()
    >>> server.n_clients
    0
    >>> server.close()
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        names: tuple[str, ...] = (),
        marker_set: str = "Asterism",
        rate: float = 0.0,
        version: tuple[int, int] = VERSIONS[-1],
        multicast: str = "",
        data_port: int = DATA_PORT,
    ) -> None:
        if version not in VERSIONS:
            known = ", ".join("{}.{}".format(*each) for each in VERSIONS)
            raise ParameterError("version", f"one of {known}", version)
        if multicast and not 224 <= int(check_host(multicast).split(".")[0]) <= 239:
            raise ParameterError("multicast", f"a multicast group, such as {GROUP}", multicast)
        super().__init__(host, port, names, rate)
        self._marker_set, self._version = marker_set, version
        self._multicast, self._data_port = multicast, data_port
        self._clients: dict[tuple[str, int], tuple[tuple[int, int], float]] = {}
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._latest: ServedFrame | None = None

    @property
    def n_clients(self) -> int:
        """Number of clients that have connected and are alive."""
        return len(self._clients)

    def start(self) -> None:
        """Listen.

        Raises
        ------
        SinkError
            If the port is in use.
        """
        self._socket = udp_socket(self.host, self.port)
        self.port = self._socket.getsockname()[1]
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2**20)
        if self._multicast:
            interface = socket.inet_aton(self.host)
            if self.host != "0.0.0.0":
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        self._waker, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._serve, name="natnet-server", daemon=True)
        self._thread.start()

    def rename(self, names: tuple[str, ...]) -> None:
        """Change the names; clients see the number of markers change and ask for them."""
        self.names = names

    def finish(self) -> None:
        """End the stream; the protocol has no message for it."""

    def send(self, frame: ServedFrame) -> None:
        """Send a frame to all clients, without waiting for any.

        Parameters
        ----------
        frame : ServedFrame
            The frame, with as many markers as there are names.
        """
        self._latest = frame
        packets: dict[tuple[int, int], bytes] = {}
        try:
            if self._multicast:
                packet = self._packet(frame, self._version)
                self._send(packet, (self._multicast, self._data_port))
                return
            with self._lock:
                clients = list(self._clients.items())
            for address, (version, _) in clients:
                if version not in packets:
                    packets[version] = self._packet(frame, version)
                self._send(packets[version], address)
        except PacketError:
            self._count("frame too large for a datagram")

    def close(self) -> None:
        """Stop listening."""
        if self._thread is None:
            return
        self._waker.close()
        self._thread.join()
        self._thread = None
        self._woken.close()
        self._socket.close()
        self._clients.clear()
        self._asked.clear()

    def _packet(self, frame: ServedFrame, version: tuple[int, int]) -> bytes:
        now = _ticks()
        return encode_frame(
            version, frame.number, frame.time, marker_set=self._marker_set, markers=frame.markers,
            points=frame.points, ids=frame.ids, ticks=(now, now, now),
        )  # fmt: skip

    def _send(self, packet: bytes, address: tuple[str, int]) -> None:
        try:
            self._socket.sendto(packet, address)
        except OSError:
            self._count("UDP not sent")

    def _serve(self) -> None:
        """Answer messages, until the server is closed."""
        while True:
            ready, _, _ = select.select([self._socket, self._woken], [], [], _ALIVE_SECONDS / 4)
            now = time.monotonic()
            if self._woken in ready:
                return
            if self._socket in ready:
                try:
                    packet, address = self._socket.recvfrom(65_536)
                    self._answer(packet, address, now)
                except (OSError, PacketError):
                    continue  # no client, or one that is gone
            with self._lock:
                alive = {a: c for a, c in self._clients.items() if now - c[1] < _ALIVE_SECONDS}
                self._clients = alive

    def _answer(self, packet: bytes, address: tuple[str, int], now: float) -> None:
        kind, body = decode_message(packet)
        version, is_known = self._version, address in self._clients
        if is_known:
            version = self._clients[address][0]
        match kind:
            case Message.CONNECT | Message.DISCOVERY:
                version = self._agreed(wanted_version(body))
                is_known |= kind == Message.CONNECT and len(self._clients) < _MAX_CLIENTS
                answer = encode_server_info(
                    ServerInfo("Asterism", version, _CLOCK_RATE, self._data_port, self._multicast)
                )
            case Message.REQUEST_MODEL:
                answer = encode_marker_set(self._marker_set, self.names, version)
            case Message.REQUEST_FRAME if self._latest is not None:
                answer = self._packet(self._latest, version)
            case Message.ECHO_REQUEST:
                answer = encode_echo(body, _ticks())
            case Message.REQUEST:
                version, answer = self._respond(bytes(body), version)
            case Message.DISCONNECT:
                with self._lock:
                    self._clients.pop(address, None)
                return
            case Message.KEEP_ALIVE:
                answer = b""
            case _:
                answer = encode_message(Message.UNRECOGNIZED)
        if is_known:
            with self._lock:
                self._clients[address] = version, now
            self._asked.set()
        if answer:
            self._socket.sendto(answer, address)

    def _agreed(self, wanted: tuple[int, int] | None) -> tuple[int, int]:
        """Return the newest version that is not newer than what the client and the server have."""
        if wanted is None or self._multicast:
            return self._version  # all clients of a group get the same packets
        return max((v for v in VERSIONS if v <= min(wanted, self._version)), default=self._version)

    def _respond(self, body: bytes, version: tuple[int, int]) -> tuple[tuple[int, int], bytes]:
        """Answer a request; return the version of the client, which it may have changed."""
        word, _, value = body.split(b"\0", 1)[0].decode("ascii", errors="replace").partition(",")
        match word.lower():
            case "bitstream":
                numbers = value.split(".")[:2]
                if len(numbers) == 2 and all(n.isdecimal() for n in numbers):
                    version = self._agreed((int(numbers[0]), int(numbers[1])))
                text = "Bitstream,{}.{}".format(*version)
                return version, encode_message(Message.RESPONSE, text.encode())
            case "framerate":
                answer = struct.pack("<f", self.rate)
            case "analogsamplespermocapframe" | "subscribetodata":
                answer = struct.pack("<i", 0)
            case "unitstomillimeters":
                answer = struct.pack("<f", 1000.0)
            case _:
                return version, encode_message(Message.UNRECOGNIZED)
        return version, encode_message(Message.RESPONSE, answer)


def _ticks() -> int:
    return math.floor(time.perf_counter() * _CLOCK_RATE)
