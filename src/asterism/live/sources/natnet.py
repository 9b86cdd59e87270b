"""Source: the stream of OptiTrack Motive, NatNet 3 and 4, with unicast or multicast."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import time
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import SourceError, SourceLost
from asterism.live.faults import Faults
from asterism.live.frame import SourceFrame
from asterism.live.protocols.natnet import (
    OCCLUDED,
    VERSIONS,
    FrameOfData,
    Message,
    decode_frame,
    decode_message,
    encode_message,
)
from asterism.live.protocols.natnet_messages import decode_server_info, encode_connect
from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["NatNetSource", "points_of"]

_CONNECT_SECONDS, _TRIES = 1.0, 5
_ALIVE_SECONDS = 1.0  # between messages that keep a unicast client subscribed
_RESTART_SECONDS = 0.5  # without a frame, after which the server may have been started anew
_SILENT_SECONDS = 5.0  # without any packet, after which the server counts as lost
_READ = 65_536
_EARLY = 1024  # frames that may arrive while the source connects


class NatNetSource:
    """Source of the markers of OptiTrack Motive, labelled or not.

    Whether frames come by unicast or multicast follows from what the server says.

    Parameters
    ----------
    name : str
        The source, as the user wrote it.
    host, port : str and int
        Address of the server, and its port for commands.
    local : str
        Address of the interface for multicast; by default the one that leads to the server.
    multicast : str
        Multicast group; by default the one of the server.
    """

    def __init__(
        self, name: str, host: str, port: int, local: str = "", multicast: str = ""
    ) -> None:
        self.name, self._address = name, (host, port)
        self._local, self._multicast = local, multicast
        self.rate = 0.0
        self.waits = False
        self._faults = Faults(name)
        self.faults: dict[str, int] = self._faults.counts
        self._command: socket.socket | None = None
        self._data: socket.socket | None = None
        self._version = VERSIONS[-1]
        self._early: deque[tuple[bytes, float]] = deque(maxlen=_EARLY)
        self._kept_alive = self._heard = self._last_frame = 0.0

    def open(self) -> None:
        """Connect and agree on a version.

        Raises
        ------
        SourceError
            If the server cannot be reached, or speaks NatNet 2.
        """
        self.close()
        self._early.clear()
        try:
            self._command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._command.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**20)
            self._command.bind((self._local, 0))
            self._command.connect(self._address)
            body = self._ask(encode_connect(VERSIONS[-1]), Message.SERVER_INFO)
            info = decode_server_info(body)
            if info.version < VERSIONS[0]:
                version = "{}.{}".format(*info.version)
                raise SourceError(f"{self.name}: expected NatNet 3 or 4, found {version}.")
            self._version = min(info.version, VERSIONS[-1])
            with contextlib.suppress(TimeoutError):
                self._read_rate()
            group = self._multicast or info.multicast
            if group:
                local = self._local or self._command.getsockname()[0]
                self._data = _joined(group, info.data_port, local)
        except (OSError, PacketError) as error:
            self.close()
            text = getattr(error, "strerror", None) or str(error) or "no answer"
            hint = "Check that Motive runs, that it broadcasts frame data, and the address"
            raise SourceError(f"{self.name}: cannot connect: {text.lower()}. {hint}.") from error
        except SourceError:
            self.close()
            raise
        self._kept_alive = self._heard = self._last_frame = time.monotonic()

    def _read_rate(self) -> None:
        body = self._ask(encode_message(Message.REQUEST, b"FrameRate\0"), Message.RESPONSE, 1)
        if len(body) == 4:
            (rate,) = struct.unpack("<f", body)
            self.rate = rate if 0 < rate < 1e6 else 0.0

    def _ask(self, message: bytes, kind: Message, tries: int = _TRIES) -> memoryview:
        """Send a message until its answer arrives; frames that arrive before it are kept."""
        assert self._command is not None
        for _ in range(tries):
            self._command.send(message)
            end = time.monotonic() + _CONNECT_SECONDS
            while (left := end - time.monotonic()) > 0:
                if not select.select([self._command], [], [], left)[0]:
                    break
                packet = self._command.recv(_READ)
                with contextlib.suppress(PacketError):
                    found, body = decode_message(packet)
                    if found == kind:
                        return body
                    if found == Message.FRAME:
                        self._early.append((packet, time.perf_counter()))
        raise TimeoutError(0, "no answer")

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        SourceLost
            If the server has been silent for five seconds, though it was asked for an answer.
        """
        end = time.monotonic() + timeout
        while True:
            if self._command is None:
                raise SourceLost("the source is not open.")
            while self._early:
                found = self._decoded(*self._early.popleft())
                if found is not None:
                    return found
            self._keep_alive()
            left = min(max(0.0, end - time.monotonic()), _ALIVE_SECONDS)
            sockets = [s for s in (self._data, self._command) if s is not None]
            for ready in select.select(sockets, [], [], left)[0]:
                try:
                    packet = ready.recv(_READ)
                except OSError as error:
                    self.close()
                    text = error.strerror or str(error)
                    raise SourceLost(f"the server is lost: {text}.") from error
                arrived = time.perf_counter()
                self._heard = time.monotonic()
                found = self._decoded(packet, arrived)
                if found is not None:
                    return found
            if time.monotonic() >= end:
                return None

    def _keep_alive(self) -> None:
        now = time.monotonic()
        if now - self._heard > _SILENT_SECONDS:
            self.close()
            raise SourceLost(f"the server has been silent for {_SILENT_SECONDS:g} s.")
        if now - self._kept_alive > _ALIVE_SECONDS:
            self._kept_alive = now
            assert self._command is not None
            # The echo is answered, so that a pause of the stream is not taken for a lost server.
            with contextlib.suppress(OSError):
                self._command.send(encode_message(Message.KEEP_ALIVE))
                self._command.send(encode_message(Message.ECHO_REQUEST, bytes(8)))
                # A server that was started anew answers echoes, but does not know this client.
                if now - self._last_frame > _RESTART_SECONDS:
                    self._command.send(encode_connect(VERSIONS[-1]))

    def _decoded(self, packet: bytes, arrived: float) -> SourceFrame | None:
        try:
            kind, body = decode_message(packet)
            if kind == Message.SERVER_INFO:
                self._version = min(decode_server_info(body).version, VERSIONS[-1])
            if kind != Message.FRAME:
                return None
            frame = decode_frame(body, self._version)
            self._last_frame = time.monotonic()
        except PacketError as error:
            self._faults.undecoded(error)
            return None
        return SourceFrame(
            number=frame.number, time=frame.time, points=points_of(frame), received=arrived,
            covariances=None,
        )  # fmt: skip

    def close(self) -> None:
        """Disconnect."""
        for each in (self._command, self._data):
            if each is not None:
                with contextlib.suppress(OSError):
                    each.close()
        self._command = self._data = None


def points_of(frame: FrameOfData) -> NDArray[np.float64]:
    """Return the measured points of a frame, shape (N, 3), metres.

    The labelled markers include the points without a label. An occluded one is a prediction of
    Motive and is left out. If Motive sends no labelled markers, the other markers are taken.
    """
    rows = frame.labelled
    if not len(rows):
        return frame.others.astype(np.float64)
    points, flags = rows["place"].astype(np.float64), rows["flags"]
    if np.bitwise_or.reduce(flags) & OCCLUDED:
        return points[flags & OCCLUDED == 0]
    return points


def _joined(group: str, port: int, local: str) -> socket.socket:
    """Return a socket that receives the packets of a multicast group."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**20)
    try:
        # Bound to the group, the socket gets no packets of other groups; Windows cannot do that.
        made.bind(("" if hasattr(socket, "SO_EXCLUSIVEADDRUSE") else group, port))
        member = socket.inet_aton(group) + socket.inet_aton(local)
        made.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
    except OSError:
        made.close()
        raise
    return made
