"""The Qualisys server, command by command, with a plain client."""

from __future__ import annotations

import socket
import struct
import time

import numpy as np
import pytest

from asterism.errors import ParameterError, SinkError
from asterism.live import QtmServer
from asterism.live.protocols import qtm
from asterism.live.protocols.qtm import Event, Packet
from asterism.live.protocols.qtm_components import Component, decode_markers, decode_points
from asterism.live.protocols.qtm_parameters import read_parameters
from tests.live.served import NAMES, Client, qtm_server, served_frames, until

FRAMES = list(served_frames(240))


@pytest.mark.parametrize("minor", range(19, 29))
def test_versions_are_agreed_as_by_the_vendor(minor):
    with qtm_server() as server, Client(server.port) as client:
        assert client.ask("Version") == (Packet.COMMAND, "Version is 1.1")
        assert client.ask(f"Version 1.{minor}") == (Packet.COMMAND, f"Version set to 1.{minor}")
        assert client.ask("version") == (Packet.COMMAND, f"Version is 1.{minor}")
        kind, text = client.ask("GetParameters General 3D 6D")
        assert kind == Packet.XML
        assert text.startswith(f"<QTM_Parameters_Ver_1.{minor}>")
        assert read_parameters(text) == (240.0, NAMES, ())


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("Version 1.29", "Version NOT supported"),
        ("Version 1.5", "Version NOT supported"),
        ("Version 9.9.9", "Version NOT supported"),
        ("TakeControl secret", "Client control disabled in QTM"),
        ("Start", "You must be master to issue this command"),
        ("Save file.qtm overwrite", "You must be master to issue this command"),
        ("SetQTMEvent jump", "You must be master to issue this command"),
        ("GetCaptureC3D", "No capture to get"),
        ("Dance", "Parse error"),
        ("", "Parse error"),
        ("GetParameters", "Parse error"),
        ("GetParameters 4D", "Parse error"),
        ("StreamFrames AllFrames", "Parse error"),
        ("StreamFrames Frequency:0 3D", "Parse error"),
        ("StreamFrames AllFrames UDP:8.8.8.8:5000 3D", "Parse error"),
        ("GetCurrentFrame 5D", "Parse error"),
    ],
)
def test_what_is_refused(command, answer):
    with qtm_server() as server, Client(server.port) as client:
        assert client.ask(command) == (Packet.ERROR, answer)


def test_state_and_byte_order():
    with qtm_server(is_replay=True) as server:
        with Client(server.port) as client:
            assert client.ask("ByteOrder") == (Packet.COMMAND, "Byte order is little endian")
            client.send("GetState")
            assert client.next() == (Packet.EVENT, bytes([Event.RT_FROM_FILE_STARTED]))
            assert client.ask("QTMVersion")[1].startswith("QTM Version is ")
        with Client(server.big_port, ">") as client:
            assert client.ask("ByteOrder") == (Packet.COMMAND, "Byte order is big endian")


@pytest.mark.parametrize("order", ["<", ">"])
def test_frames_in_both_byte_orders(order):
    with qtm_server() as server:
        port = server.port if order == "<" else server.big_port
        with Client(port, order) as client:
            client.send("StreamFrames AllFrames 3D 3DNoLabelsRes 6DEuler Skeleton:global")
            assert server.wait_for_client(5)
            for frame in FRAMES[:50]:
                server.send(frame)
                kind, body = client.next()
                assert kind == Packet.DATA
                data = qtm.decode_data(body, order)
                assert data.number == frame.number
                assert data.time == round(frame.time * 1e6) / 1e6
                markers = decode_markers(data.components[1], order=order)
                points, ids = decode_points(data.components[10], residuals=True, order=order)
                want = (frame.markers * 1000).astype(np.float32)
                np.testing.assert_array_equal((markers * 1000).astype(np.float32), want)
                want = (frame.points * 1000).astype(np.float32)
                np.testing.assert_array_equal((points * 1000).astype(np.float32), want)
                np.testing.assert_array_equal(ids, frame.ids)
                assert bytes(data.components[Component.BODIES_EULER]) == bytes(8)
                assert bytes(data.components[Component.SKELETON]) == bytes(4)


def test_events_and_the_end():
    with qtm_server() as server, Client(server.port) as client:
        client.send("StreamFrames AllFrames 3D")
        assert server.wait_for_client(5)
        server.send(FRAMES[0])
        server.rename((*NAMES, "NEW"))
        server.finish()
        kinds = [client.next() for _ in range(4)]
        assert kinds[0][0] == Packet.DATA
        assert kinds[1] == (Packet.EVENT, bytes([Event.CAMERA_SETTINGS_CHANGED]))
        assert kinds[2] == (Packet.NO_MORE_DATA, b"")
        assert kinds[3] == (Packet.EVENT, bytes([Event.CONNECTION_CLOSED]))
        assert read_parameters(client.ask("GetParameters 3D")[1]).names[-1] == "NEW"
        client.send("GetCurrentFrame 3D")
        assert client.next() == (Packet.NO_MORE_DATA, b"")
        server.close()
        assert client.next() == (Packet.EVENT, bytes([Event.SHUTTING_DOWN]))
        assert client.next() is None


def test_current_frame_is_the_next_one():
    with qtm_server() as server, Client(server.port) as client:
        for frame in FRAMES[:3]:
            client.send("GetCurrentFrame 3DNoLabels")
            until(lambda: any(c.once is not None for c in server._clients))
            server.send(frame)
            kind, body = client.next()
            assert (kind, qtm.decode_data(body).number) == (Packet.DATA, frame.number)
        server.send(FRAMES[3])  # it was not asked for
        assert client.ask("ByteOrder")[0] == Packet.COMMAND


@pytest.mark.parametrize(
    ("rate", "want"),
    [
        ("FrequencyDivisor:4", list(range(1, 241, 4))),
        ("Frequency:60", list(range(1, 241, 4))),
        ("Frequency:1000", list(range(1, 241))),
    ],
)
def test_rates(rate, want):
    with qtm_server() as server, Client(server.port) as client:
        client.send(f"StreamFrames {rate} 3DNoLabels")
        assert server.wait_for_client(5)
        for frame in FRAMES:
            server.send(frame)
        numbers = [qtm.decode_data(client.next()[1]).number for _ in want]
        assert numbers == want
        client.send("StreamFrames Stop")
        assert client.ask("ByteOrder")[0] == Packet.COMMAND  # no frame is in between


def test_a_rate_that_does_not_divide_keeps_its_mean():
    with qtm_server() as server, Client(server.port) as client:
        client.send("StreamFrames Frequency:100 3DNoLabels")
        assert server.wait_for_client(5)
        for frame in FRAMES:
            server.send(frame)
        client.send("StreamFrames Stop")
        client.send("ByteOrder")
        n = 0
        while client.next()[0] == Packet.DATA:
            n += 1
        assert 99 <= n <= 101


def test_frames_by_udp():
    with qtm_server() as server, Client(server.port) as client:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with receiver:
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(5)
            client.send(f"StreamFrames AllFrames UDP:{receiver.getsockname()[1]} 3D")
            assert server.wait_for_client(5)
            server.send(FRAMES[0])
            packet = receiver.recv(65536)
        assert struct.unpack_from("<II", packet) == (len(packet), Packet.DATA)
        assert qtm.decode_data(packet[8:]).number == 1


def test_a_slow_client_misses_frames_and_delays_no_other():
    with qtm_server() as server, Client(server.port) as slow, Client(server.port) as quick:
        slow.send("StreamFrames AllFrames 3D")
        quick.send("StreamFrames AllFrames 3D")
        until(lambda: sum(c.request is not None for c in server._clients) == 2)
        longest = 0.0
        n = 6000
        for i in range(n):
            frame = FRAMES[i % len(FRAMES)]
            begin = time.perf_counter()
            server.send(frame)
            longest = max(longest, time.perf_counter() - begin)
            assert qtm.decode_data(quick.next()[1]).number == frame.number
        assert 0 < server.faults["slow client"] < n
        assert longest < 1.0  # `send` never waits for a socket; this machine may
        # What the slow client reads later are whole frames.
        kind, body = slow.next()
        assert (kind, qtm.decode_data(body).number) == (Packet.DATA, 1)


def test_garbage_ends_only_the_connection_that_sent_it():
    with qtm_server() as server, Client(server.port) as good:
        for data in (b"GET / HTTP/1.1\r\n\r\n", bytes(8), struct.pack("<II", 2**31, 1)):
            with Client(server.port) as bad:
                bad.socket.sendall(data)
                assert bad.next() is None
        assert good.ask("ByteOrder")[0] == Packet.COMMAND
        until(lambda: server.n_clients == 1)


def test_a_client_that_reads_no_answers_is_dropped():
    with qtm_server() as server:
        with Client(server.port) as client:
            client.socket.setblocking(False)
            command = qtm.encode_text(Packet.COMMAND, "GetParameters All")
            end = time.monotonic() + 20
            while server.n_clients and time.monotonic() < end:
                try:
                    client.socket.send(command)
                except BlockingIOError:
                    time.sleep(0.001)
                except OSError:
                    break
        until(lambda: server.n_clients == 0)


def test_discovery():
    with qtm_server() as found:
        free = found.big_port  # some port that was free a moment ago
    with qtm_server(discovery_port=free) as server:
        client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with client:
            client.bind(("127.0.0.1", 0))
            client.settimeout(5)
            client.sendto(b"garbage", ("127.0.0.1", free))
            client.sendto(qtm.discovery(client.getsockname()[1]), ("127.0.0.1", free))
            answer = client.recv(1024)
    size, kind = struct.unpack_from("<II", answer)
    assert (size, kind) == (len(answer), Packet.COMMAND)
    assert b"cameras\0" in answer
    assert struct.unpack(">H", answer[-2:]) == (server.port - 1,)


def test_ports_in_use_and_wrong_hosts():
    with qtm_server() as server:
        with pytest.raises(SinkError, match="Choose another port"):
            QtmServer(port=server.port).start()
        with pytest.raises(SinkError, match="Choose another port"):
            QtmServer(port=server.big_port - 1).start()
    with pytest.raises(ParameterError, match="an IPv4 address"):
        QtmServer("somewhere")


def test_a_server_can_be_started_again():
    server = QtmServer(port=0, discovery_port=0)
    for _ in range(3):
        server.start()
        with Client(server.port) as client:
            assert client.ask("ByteOrder")[0] == Packet.COMMAND
        server.close()
        server.close()
