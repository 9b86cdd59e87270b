"""Server that speaks the Qualisys real-time protocol.

Frames are sent by the thread that has them; a thread of the server accepts clients, answers
commands, and sends what a socket did not take at once. A client that reads too slowly misses whole
frames, which are counted, and no other client waits for it.
"""

from __future__ import annotations

import logging
import selectors
import socket
import struct
import threading
from typing import TYPE_CHECKING, cast

import asterism
from asterism.camera import Rig
from asterism.checks import check_kind
from asterism.errors import SinkError
from asterism.io.calibrations import qca
from asterism.live.protocols import qtm
from asterism.live.protocols.packet_error import PacketError
from asterism.live.protocols.qtm import Event, Packet
from asterism.live.protocols.qtm_components import (
    Component,
    encode_2d,
    encode_nothing,
    encode_positions,
)
from asterism.live.servers.base import Server
from asterism.live.servers.listening import tcp_listener, udp_socket
from asterism.live.servers.qtm_connection import Connection

if TYPE_CHECKING:
    from asterism.live.protocols.qtm_commands import FrameRequest
    from asterism.live.servers.served_frame import ServedFrame

__all__ = ["DISCOVERY_PORT", "PORT", "QtmServer"]

log = logging.getLogger(__name__)

PORT = 22223
"""Usual port for little-endian clients; that for big-endian clients is the next."""
DISCOVERY_PORT = 22226
"""UDP port on which servers are searched."""
_MAX_CLIENTS = 100
_SEND_BUFFER = 128 * 1024  # bytes; a larger one would only delay the frames of a slow client
_LONGEST_DATAGRAM = 65_507  # bytes


class QtmServer(Server):
    """Server of frames for clients of Qualisys Track Manager.

    Parameters
    ----------
    host : str
        Address of the interface; ``127.0.0.1`` serves this machine only.
    port : int
        TCP port for little-endian clients; the next one is for big-endian clients. 0 takes free
        ports.
    names : tuple of str
        Labels of the markers.
    rate : float
        Frame rate that clients are shown, Hz.
    is_replay : bool
        Whether clients see a file that is played instead of a measurement.
    discovery_port : int
        UDP port for discovery; 0 for none.
    rig : Rig, optional
        Cameras of the image points, whose calibration clients can ask for.

    Attributes
    ----------
    faults : dict of str to int
        Number of frames that clients missed, by reason.

    Raises
    ------
    ParameterError
        If a calibration of Qualisys cannot hold the cameras (another lens than `BrownConrady`,
        skew, the same name twice).

    Examples
    --------
    >>> server = QtmServer(port=0, discovery_port=0, names=("LASI", "RASI"), rate=240.0)
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
        rate: float = 0.0,
        is_replay: bool = False,
        discovery_port: int = DISCOVERY_PORT,
        rig: Rig | None = None,
    ) -> None:
        super().__init__(host, port, names, rate)
        if rig is not None:
            check_kind("rig", rig, Rig, "am.read_rig(path)")
            qca.encode(rig)
        self.rig = rig
        self.big_port = port + 1 if port else 0
        self._discovery_port = discovery_port
        self._running = Event.RT_FROM_FILE_STARTED if is_replay else Event.CONNECTED
        self._ended = Event.RT_FROM_FILE_STOPPED if is_replay else Event.CONNECTION_CLOSED
        self._state = self._running
        self._clients: list[Connection] = []
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._is_closing = False

    @property
    def n_clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def start(self) -> None:
        """Listen.

        Raises
        ------
        SinkError
            If a port is in use.
        """
        little = tcp_listener(self.host, self.port)
        try:
            big = tcp_listener(self.host, self.big_port)
        except SinkError:
            little.close()
            raise
        self.port, self.big_port = little.getsockname()[1], big.getsockname()[1]
        self._selector = selectors.DefaultSelector()
        self._selector.register(little, selectors.EVENT_READ, "<")
        self._selector.register(big, selectors.EVENT_READ, ">")
        if self._discovery_port:
            try:
                found = udp_socket(self.host, self._discovery_port)
                self._selector.register(found, selectors.EVENT_READ, "discovery")
            except SinkError as error:
                log.warning("%s Clients must be given the address of this server.", error)
        self._waker, woken = socket.socketpair()
        woken.setblocking(False)
        self._waker.setblocking(False)
        self._selector.register(woken, selectors.EVENT_READ, "woken")
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.setblocking(False)
        self._is_closing = False
        self._thread = threading.Thread(target=self._serve, name="qtm-server", daemon=True)
        self._thread.start()

    def rename(self, names: tuple[str, ...]) -> None:
        """Change the labels, and let clients know that they must read them again."""
        with self._lock:
            self.names = names
        self._report(Event.CAMERA_SETTINGS_CHANGED)

    def finish(self) -> None:
        """Report the end of the measurement to all clients."""
        self._state = self._ended
        with self._lock:
            for client in self._clients:
                if client.request is not None or client.once is not None:
                    client.write(qtm.encode_empty(Packet.NO_MORE_DATA, client.order))
                client.once = None
        self._report(self._ended)

    def send(self, frame: ServedFrame) -> None:
        """Send a frame to all clients that want it, without waiting for any.

        Parameters
        ----------
        frame : ServedFrame
            The frame, with as many markers as there are names.
        """
        packets: dict[tuple[tuple[Component, ...], str], bytes] = {}
        must_wake = False
        with self._lock:
            for client in self._clients:
                if client.once is not None:
                    client.write(_packet(client.once, client.order, frame, packets))
                    client.once = None
                if client.wants(frame):
                    assert client.request is not None
                    packet = _packet(client.request, client.order, frame, packets)
                    if client.request.udp is not None:
                        self._send_datagram(packet, client.request.udp)
                    elif client.pending:
                        self._count("slow client")
                    else:
                        client.write(packet)
                must_wake |= bool(client.pending) or client.is_over
        if must_wake:
            self._wake()

    def close(self) -> None:
        """Disconnect all clients and stop listening."""
        if self._thread is None:
            return
        self._report(Event.SHUTTING_DOWN)
        self._is_closing = True
        self._wake()
        self._thread.join()
        self._thread = None
        self._waker.close()
        self._udp.close()
        self._asked.clear()

    def _report(self, event: Event) -> None:
        with self._lock:
            for client in self._clients:
                client.write(qtm.encode_event(event, client.order))

    def _send_datagram(self, packet: bytes, target: tuple[str, int]) -> None:
        if len(packet) > _LONGEST_DATAGRAM:
            self._count("frame too large for UDP")
            return
        try:
            self._udp.sendto(packet, target)
        except OSError:
            self._count("UDP not sent")

    def _wake(self) -> None:
        try:
            self._waker.send(b"\0")
        except OSError:
            return  # the thread has enough to wake up for, or is gone

    def _serve(self) -> None:
        """Accept, answer and flush, until the server is closed."""
        while not self._is_closing:
            for key, mask in self._selector.select():
                found = cast("socket.socket", key.fileobj)  # nothing else is registered
                if isinstance(key.data, Connection):
                    self._attend(key.data, mask)
                elif key.data == "woken":
                    found.recv(4096)
                elif key.data == "discovery":
                    self._answer_discovery(found)
                else:
                    self._accept(found, key.data)
            self._tidy()
        for key in list(self._selector.get_map().values()):
            cast("socket.socket", key.fileobj).close()
        self._selector.close()
        self._clients.clear()

    def _accept(self, listener: socket.socket, order: str) -> None:
        try:
            client, address = listener.accept()
        except OSError:
            return
        if len(self._clients) >= _MAX_CLIENTS:
            client.close()
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        connection = Connection(client, address, order, self.host, self.rig)
        connection.answer("QTM RT Interface connected")
        self._selector.register(client, selectors.EVENT_READ, connection)
        with self._lock:
            self._clients.append(connection)

    def _attend(self, client: Connection, mask: int) -> None:
        with self._lock:
            if mask & selectors.EVENT_WRITE:
                client.flush()
            if mask & selectors.EVENT_READ:
                for command in client.read():
                    client.obey(command, self.names, self.rate, self._state)
                if client.request is not None or client.once is not None:
                    self._asked.set()

    def _tidy(self) -> None:
        """Watch for room where bytes wait, and remove the clients that are gone."""
        with self._lock:
            for client in list(self._clients):
                if client.is_over:
                    self._selector.unregister(client.socket)
                    client.socket.close()
                    self._clients.remove(client)
                    continue
                wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.pending else 0)
                if self._selector.get_key(client.socket).events != wanted:
                    self._selector.modify(client.socket, wanted, client)

    def _answer_discovery(self, found: socket.socket) -> None:
        try:
            packet, address = found.recvfrom(64)
            port = qtm.decode_discovery(packet)
            n = 0 if self.rig is None else len(self.rig)
            about = f"{socket.gethostname()}, Asterism {asterism.__version__}, {n} cameras"
            found.sendto(qtm.encode_discovered(about, self.port - 1), (address[0], port))
        except (OSError, PacketError, struct.error):
            return  # no client, or one that is gone


def _packet(
    request: FrameRequest,
    order: str,
    frame: ServedFrame,
    known: dict[tuple[tuple[Component, ...], str], bytes],
) -> bytes:
    """Return the packet of a frame; clients with the same wishes share it."""
    key = request.components, order
    if key not in known:
        parts = [_component(kind, order, frame) for kind in request.components]
        known[key] = qtm.encode_data(frame.time, frame.number, parts, order)
    return known[key]


def _component(kind: Component, order: str, frame: ServedFrame) -> bytes:
    match kind:
        case Component.MARKERS | Component.MARKERS_RESIDUAL:
            return encode_positions(kind, frame.markers, order=order)
        case Component.POINTS | Component.POINTS_RESIDUAL:
            return encode_positions(kind, frame.points, frame.ids, order)
        case Component.IMAGE_POINTS:
            return encode_2d(frame.images or (), order)
        case _:
            return encode_nothing(kind, order)
