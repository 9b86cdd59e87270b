"""The NatNet server, message by message, with a plain client."""

from __future__ import annotations

import contextlib
import socket
import struct
import time

import numpy as np
import pytest

from asterism.errors import ParameterError, SinkError, SourceLost
from asterism.live import NatNetServer, ServedFrame
from asterism.live.protocols.natnet import (
    VERSIONS,
    Message,
    decode_frame,
    decode_message,
    encode_message,
)
from asterism.live.protocols.natnet_messages import (
    decode_marker_sets,
    decode_server_info,
    encode_connect,
)
from asterism.live.servers.natnet import GROUP
from asterism.live.sources.natnet import NatNetSource
from tests.live.served import NAMES, natnet_server, served_frames, until

FRAMES = list(served_frames(100))


@contextlib.contextmanager
def plain_client(server):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", server.port))
        client.settimeout(5)
        yield client


def ask(client, kind, body=b""):
    client.send(encode_message(kind, body))
    return decode_message(client.recv(65536))


@pytest.mark.parametrize("version", VERSIONS)
def test_connection_definitions_and_frames(version):
    with natnet_server() as server, plain_client(server) as client:
        client.send(encode_connect(version))
        kind, body = decode_message(client.recv(65536))
        info = decode_server_info(body)
        assert (kind, info.version, info.multicast) == (Message.SERVER_INFO, version, "")
        kind, body = ask(client, Message.REQUEST_MODEL)
        assert decode_marker_sets(body, version) == {"Asterism": NAMES}
        for frame in FRAMES[:20]:
            server.send(frame)
            kind, body = decode_message(client.recv(65536))
            found = decode_frame(body, version)
            assert (kind, found.number, found.time) == (Message.FRAME, frame.number, frame.time)
            want = frame.markers.astype(np.float32)
            np.testing.assert_array_equal(found.marker_sets["Asterism"], want)
            assert found.sent > 0


def test_a_client_gets_no_newer_version_than_the_server_has():
    with natnet_server(version=(3, 1)) as server, plain_client(server) as client:
        for wanted, got in {(4, 1): (3, 1), (3, 0): (3, 0), (2, 9): (3, 1), (4, 2): (3, 1)}.items():
            client.send(encode_connect(wanted))
            assert decode_server_info(decode_message(client.recv(65536))[1]).version == got


def test_requests():
    with natnet_server() as server, plain_client(server) as client:
        client.send(encode_connect((4, 1)))
        client.recv(65536)
        kind, body = ask(client, Message.REQUEST, b"FrameRate\0")
        assert (kind, struct.unpack("<f", body)) == (Message.RESPONSE, (240.0,))
        kind, body = ask(client, Message.REQUEST, b"Bitstream,3.0\0")
        assert (kind, bytes(body)) == (Message.RESPONSE, b"Bitstream,3.0")
        server.send(FRAMES[0])
        assert decode_frame(decode_message(client.recv(65536))[1], (3, 0)).number == 1
        assert bytes(ask(client, Message.REQUEST, b"Bitstream\0")[1]) == b"Bitstream,3.0"
        assert ask(client, Message.REQUEST, b"TestRequest\0")[0] == Message.UNRECOGNIZED
        assert ask(client, 77)[0] == Message.UNRECOGNIZED
        kind, body = ask(client, Message.ECHO_REQUEST, b"12345678")
        assert (kind, bytes(body[:8])) == (Message.ECHO_RESPONSE, b"12345678")
        assert ask(client, Message.REQUEST_FRAME)[0] == Message.FRAME
        client.send(encode_message(Message.DISCONNECT))
        until(lambda: server.n_clients == 0)


def test_only_those_who_connect_get_frames():
    with natnet_server() as server, plain_client(server) as client:
        assert ask(client, Message.DISCOVERY, bytes(264))[0] == Message.SERVER_INFO
        for garbage in (b"", b"\0", b"\xff" * 50, encode_message(Message.KEEP_ALIVE)):
            client.send(garbage)
        server.send(FRAMES[0])
        client.settimeout(0.2)
        with pytest.raises(TimeoutError):
            client.recv(65536)
        assert server.n_clients == 0


@pytest.mark.parametrize("multicast", ["", GROUP])
@pytest.mark.parametrize("version", VERSIONS)
def test_our_own_source(version, multicast):
    with natnet_server(version=version, multicast=multicast, data_port=15_112) as server:
        source = NatNetSource("natnet", "127.0.0.1", server.port)
        source.open()
        assert source.rate == 240.0
        for frame in FRAMES:
            server.send(frame)
            found = source.receive(5)
            assert (found.number, found.time) == (frame.number, frame.time)
            seen = frame.markers[np.isfinite(frame.markers[:, 0])]
            want = np.vstack([seen, frame.points]).astype(np.float32)
            np.testing.assert_array_equal(found.points, want)
        assert source.faults == {}
        source.close()


def test_a_pause_is_no_loss_and_a_silent_server_is(monkeypatch):
    import asterism.live.sources.natnet as module

    monkeypatch.setattr(module, "_SILENT_SECONDS", 0.6)
    monkeypatch.setattr(module, "_ALIVE_SECONDS", 0.1)
    with natnet_server() as server:
        source = NatNetSource("natnet", "127.0.0.1", server.port)
        source.open()
        assert source.receive(1.5) is None  # echoes keep it
    with pytest.raises(SourceLost):
        [source.receive(0.1) for _ in range(30)]
    begin = time.monotonic()
    with pytest.raises(SourceLost):
        source.receive(5)
    assert time.monotonic() - begin < 1


def test_frames_that_no_datagram_holds_are_counted():
    with natnet_server(names=()) as server, plain_client(server) as client:
        client.send(encode_connect((4, 1)))
        client.recv(65536)
        n = 2000
        server.send(
            ServedFrame(number=1, time=0.0, markers=np.empty((0, 3)), points=np.ones((n, 3)),
                        ids=np.arange(n))
        )  # fmt: skip
        assert server.faults == {"frame too large for a datagram": 1}


def test_what_makes_no_server():
    with pytest.raises(ParameterError, match=r"one of 3\.0"):
        NatNetServer(version=(2, 9))
    with pytest.raises(ParameterError, match="a multicast group"):
        NatNetServer(multicast="10.0.0.1")
    with natnet_server() as server, pytest.raises(SinkError, match="Choose another port"):
        NatNetServer(port=server.port).start()
