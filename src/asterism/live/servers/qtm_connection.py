"""One client of the Qualisys server: its commands, and the bytes that wait for it."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING

from asterism.live.protocols import qtm
from asterism.live.protocols.packet_error import PacketError
from asterism.live.protocols.qtm import Event, Packet
from asterism.live.protocols.qtm_commands import (
    FrameRequest,
    read_components,
    read_stream_request,
)
from asterism.live.protocols.qtm_parameters import SECTIONS, encode_parameters
from asterism.live.servers.listening import is_loopback

if TYPE_CHECKING:
    import socket

    from asterism.camera import Rig
    from asterism.live.servers.served_frame import ServedFrame

__all__ = ["NEWEST", "OLDEST", "Connection"]

OLDEST, NEWEST = (1, 12), (1, 28)
"""Versions of the protocol that clients may choose."""
_UNSET = (1, 1)  # until the client chooses one
_LONGEST_COMMAND = 64 * 1024  # bytes
_LONGEST_WAIT = 2**20  # bytes of answers that a client may leave unread
_REFUSED = {
    "takecontrol": "Client control disabled in QTM",
    "releasecontrol": "You are already a regular client",
    "getcapturec3d": "No capture to get",
    "getcaptureqtm": "No capture to get",
    "checklicense": "License fail",
} | dict.fromkeys(
    ("new", "close", "start", "stop", "load", "save", "loadproject", "trig", "setqtmevent",
     "event", "reprocess", "calibrate", "led"),
    "You must be master to issue this command",
)  # fmt: skip


class Connection:
    """State of one client.

    Parameters
    ----------
    client : socket
        Its socket, which does not block.
    address : tuple of str and int
        Its address.
    order : str
        Byte order of its port.
    host : str
        Interface of the server.
    rig : Rig or None
        Cameras of the server.
    """

    def __init__(
        self,
        client: socket.socket,
        address: tuple[str, int],
        order: str,
        host: str,
        rig: Rig | None = None,
    ) -> None:
        self._rig = rig
        self.socket, self.address, self.order, self._host = client, address, order, host
        self.version = _UNSET
        self.request: FrameRequest | None = None
        self.once: FrameRequest | None = None  # a frame that GetCurrentFrame waits for
        self.pending = bytearray()  # bytes that the socket has not taken yet
        self.is_over = False
        self._received = bytearray()
        self._n_frames = 0  # of the stream, for the divisor
        self._due = 0.0  # time of the next frame, for the frequency

    def wants(self, frame: ServedFrame) -> bool:
        """Return whether the rate of the request includes a frame."""
        if self.request is None:
            return False
        if self.request.frequency:
            step = 1.0 / self.request.frequency
            if frame.time < self._due - 1e-6 <= frame.time + step:
                return False
            # One step on from the last due time keeps the mean rate; a jump begins anew.
            is_near = abs(frame.time - self._due) < step
            self._due = (self._due if is_near else frame.time) + step
            return True
        self._n_frames += 1
        return (self._n_frames - 1) % self.request.divisor == 0

    def write(self, packet: bytes) -> None:
        """Send a packet, or keep what the socket does not take now."""
        if self.is_over:
            return
        if not self.pending:
            try:
                taken = self.socket.send(packet)
            except BlockingIOError:
                taken = 0
            except OSError:
                self.is_over = True
                return
            if taken == len(packet):
                return
            packet = packet[taken:]
        self.pending += packet
        self.is_over = len(self.pending) > _LONGEST_WAIT

    def flush(self) -> None:
        """Send what waits, as far as the socket takes it."""
        try:
            taken = self.socket.send(self.pending)
        except BlockingIOError:
            return
        except OSError:
            self.is_over = True
            return
        del self.pending[:taken]

    def answer(self, text: str, kind: Packet = Packet.COMMAND) -> None:
        """Send an answer."""
        self.write(qtm.encode_text(kind, text, self.order))

    def read(self) -> list[str]:
        """Return the commands that have arrived completely."""
        try:
            received = self.socket.recv(_LONGEST_COMMAND)
        except BlockingIOError:
            return []
        except OSError:
            received = b""
        self.is_over |= not received
        self._received += received
        commands: list[str] = []
        try:
            while (found := qtm.split(self._received, self.order)) is not None:
                kind, body = found
                text, size = qtm.text_of(body), len(body) + 8
                body.release()
                del self._received[:size]
                # XML would change settings, which only the master may.
                if kind == Packet.COMMAND:
                    commands.append(text)
                else:
                    commands.append("new" if kind == Packet.XML else "")
        except PacketError:
            self.is_over = True
        self.is_over |= len(self._received) > _LONGEST_COMMAND
        return commands

    def obey(self, command: str, names: tuple[str, ...], rate: float, state: Event) -> None:
        """Carry out a command.

        Parameters
        ----------
        command : str
            The command with its arguments.
        names : tuple of str
            Labels of the markers.
        rate : float
            Frame rate, Hz.
        state : Event
            State of the server.
        """
        word, *words = command.split() or [""]
        match word.lower():
            case "version":
                self._choose(words)
            case "qtmversion":
                self.answer("QTM Version is 2024.1 (build 1)")
            case "byteorder":
                little = self.order == "<"
                self.answer(f"Byte order is {'little' if little else 'big'} endian")
            case "getstate" | "getlastevent":
                self.write(qtm.encode_event(state, self.order))
            case "getparameters":
                self._describe(words, names, rate)
            case "getcurrentframe" | "streamframes":
                self._deliver(word.lower(), words, state)
            case other if other in _REFUSED:
                self.answer(_REFUSED[other], Packet.ERROR)
            case _:
                self.answer("Parse error", Packet.ERROR)

    def _choose(self, words: list[str]) -> None:
        if not words:
            self.answer("Version is {}.{}".format(*self.version))
            return
        match = re.fullmatch(r"([0-9]{1,2})\.([0-9]{1,2})", words[0])
        version = (int(match[1]), int(match[2])) if match else (0, 0)
        if not OLDEST <= version <= NEWEST:
            self.answer("Version NOT supported", Packet.ERROR)
            return
        self.version = version
        self.answer("Version set to {}.{}".format(*version))

    def _describe(self, words: list[str], names: tuple[str, ...], rate: float) -> None:
        sections = tuple(word.lower() for word in words)
        if sections == ("all",):
            sections = SECTIONS
        if not sections or not set(sections) <= set(SECTIONS):
            self.answer("Parse error", Packet.ERROR)
            return
        version = "{}.{}".format(*self.version)
        text = encode_parameters(sections, version, names=names, rate=rate, rig=self._rig)
        self.answer(text, Packet.XML)

    def _deliver(self, word: str, words: list[str], state: Event) -> None:
        try:
            if word == "getcurrentframe":
                self.once = FrameRequest(read_components(words))
            elif [w.lower() for w in words] == ["stop"]:
                self.request = None
                return
            else:
                request = read_stream_request(words)
                self.request = self._checked(request)
                self._n_frames, self._due = 0, 0.0
        except PacketError:
            self.answer("Parse error", Packet.ERROR)
            return
        if state not in (Event.CONNECTED, Event.RT_FROM_FILE_STARTED):
            self.once = None
            self.write(qtm.encode_empty(Packet.NO_MORE_DATA, self.order))

    def _checked(self, request: FrameRequest) -> FrameRequest:
        """Fill in the address for UDP; a server for this machine sends to no other."""
        if request.udp is None:
            return request
        address = request.udp[0] or self.address[0]
        try:
            struct.pack("4B", *map(int, address.split(".")))
        except (ValueError, struct.error):
            raise PacketError("no IPv4 address") from None
        if is_loopback(self._host) and not is_loopback(address):
            raise PacketError("an address of another machine")
        return request._replace(udp=(address, request.udp[1]))
