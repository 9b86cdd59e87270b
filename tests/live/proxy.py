"""Proxies between a server and a source, which inject faults into the frames on their way.

A fault is a function of the packet of a frame; it returns the packets that go on instead. All other
packets, such as commands and their answers, pass as they are.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading

from asterism.live.protocols import qtm
from asterism.live.protocols.natnet import Message
from asterism.live.protocols.qtm import Packet


class Proxy:
    """What both proxies share: a thread that relays until it is closed, and a cut line."""

    def __init__(self, server_port, fault):
        self.server_port, self.is_cut = server_port, False
        self._fault, self._is_closing = fault, False
        self._thread = threading.Thread(target=self._relay, name="proxy")

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._is_closing = True
        self._thread.join()
        self._front.close()


class UdpProxy(Proxy):
    """Proxy of NatNet by unicast. What is sent while the line is cut is lost."""

    def __init__(self, server_port, fault):
        super().__init__(server_port, fault)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self.port = self._front.getsockname()[1]

    def _relay(self):
        client = None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
            back.connect(("127.0.0.1", self.server_port))
            while not self._is_closing:
                for ready in select.select([self._front, back], [], [], 0.05)[0]:
                    with contextlib.suppress(OSError):  # no server or no client for a moment
                        packet, address = ready.recvfrom(65_536)
                        if self.is_cut:
                            continue
                        if ready is self._front:
                            client = address
                            back.send(packet)
                            continue
                        is_frame = packet[0] == Message.FRAME
                        for each in self._fault(packet) if is_frame else [packet]:
                            self._front.sendto(each, client)


class TcpProxy(Proxy):
    """Proxy of the Qualisys protocol, one client at a time. A cut line keeps what is sent."""

    def __init__(self, server_port, fault):
        super().__init__(server_port, fault)
        self._front = socket.create_server(("127.0.0.1", 0))
        self._front.settimeout(0.05)
        self.port = self._front.getsockname()[1]

    def _relay(self):
        while not self._is_closing:
            with contextlib.suppress(OSError):  # no client yet, or one of them is gone
                client, _ = self._front.accept()
                client.settimeout(None)
                with client, socket.create_connection(("127.0.0.1", self.server_port)) as server:
                    self._join(client, server)

    def _join(self, client, server):
        received = bytearray()
        for each in (client, server):
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while not self._is_closing:
            for ready in select.select([client, server], [], [], 0.01)[0]:
                data = ready.recv(65_536)
                if not data:
                    return
                if ready is client:
                    server.sendall(data)
                else:
                    received += data
            while not self.is_cut and (found := qtm.split(received)) is not None:
                size = len(found[1]) + 8
                found[1].release()
                packet = bytes(received[:size])
                del received[:size]
                is_frame = found[0] == Packet.DATA
                client.sendall(b"".join(self._fault(packet) if is_frame else [packet]))


def nothing(rng):
    return lambda packet: [packet]


def loss(rng):
    """One packet of a hundred is lost."""
    return lambda packet: [] if rng.random() < 0.01 else [packet]


def bursts_of_losses(rng):
    """Ten to forty packets in a row are lost, about every hundred packets."""
    left = 0

    def fault(packet):
        nonlocal left
        if not left and rng.random() < 0.01:
            left = int(rng.integers(10, 40))
        left = max(left - 1, 0)
        return [] if left else [packet]

    return fault


def late_bursts(rng):
    """Packets wait, and arrive up to forty at a time."""
    held = []

    def fault(packet):
        held.append(packet)
        if 0 < len(held) < 40 and (len(held) > 1 or rng.random() < 0.02):
            return []
        out = held.copy()
        held.clear()
        return out

    return fault


def duplicates(rng):
    """Five packets of a hundred arrive twice."""
    return lambda packet: [packet] * (1 + (rng.random() < 0.05))


def reordering(rng):
    """Two packets of a hundred arrive one to five packets later."""
    held, n = [], 0

    def fault(packet):
        nonlocal n
        n += 1
        due = [p for at, p in held if at <= n]
        held[:] = [(at, p) for at, p in held if at > n]
        if rng.random() < 0.02:
            held.append((n + int(rng.integers(1, 6)), packet))
            return due
        return [packet, *due]

    return fault


def truncated(rng):
    """Two packets of a hundred lack their end."""
    return lambda packet: [
        packet if rng.random() > 0.02 else packet[: int(rng.integers(1, len(packet)))]
    ]


def garbage(rng):
    """Two packets of a hundred follow random bytes, half of which have the head of a frame."""

    def fault(packet):
        if rng.random() > 0.02:
            return [packet]
        noise = rng.bytes(int(rng.integers(9, len(packet))))
        head = packet[:8] if rng.random() < 0.5 else b""
        return [(head + noise)[: len(packet)], packet]

    return fault
