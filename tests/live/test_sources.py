"""The sources: what they deliver, and how they fail."""

from __future__ import annotations

import io
import json
import logging
import math
import socket
import struct
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError, SourceError, SourceLost
from asterism.live.faults import Faults
from asterism.live.protocols import qtm
from asterism.live.protocols.qtm import Packet
from asterism.live.protocols.qtm_components import Component, encode_positions
from asterism.live.receiver import Receiver
from asterism.live.sources.base import EndOfSource
from asterism.live.sources.json_lines import StandardInput, UdpSource
from asterism.live.sources.lsl import LslSource
from asterism.live.sources.natnet import NatNetSource
from asterism.live.sources.parse import parse_source
from asterism.live.sources.qtm import QtmSource
from asterism.live.sources.replay import ReplaySource
from tests.live.served import qtm_server, served_frames, until

FRAMES = list(served_frames(100))


def test_qtm_delivers_markers_and_points():
    with qtm_server() as server:
        source = QtmSource("qtm", "127.0.0.1", server.port)
        source.open()
        assert source.rate == 240.0
        assert server.wait_for_client(5)
        assert source.receive(0.05) is None
        for frame in FRAMES:
            server.send(frame)
            before = time.perf_counter()
            found = source.receive(5)
            assert (found.number, found.time) == (frame.number, round(frame.time * 1e6) / 1e6)
            seen = frame.markers[np.isfinite(frame.markers[:, 0])]
            want = (np.vstack([seen, frame.points]) * 1000).astype(np.float32) / 1000
            np.testing.assert_allclose(found.points, want, rtol=1e-6)
            assert before <= found.received <= time.perf_counter()
        server.finish()
        assert source.receive(0.05) is None  # the end of a measurement; the next may follow
        server.close()
        with pytest.raises(SourceLost, match="closed the connection"):
            source.receive(5)
        with pytest.raises(SourceLost):
            source.receive(5)


@pytest.mark.parametrize(
    "source",
    [
        QtmSource("qtm://127.0.0.1", "127.0.0.1", 1),
        NatNetSource("natnet://127.0.0.1", "127.0.0.1", 1),
        LslSource("lsl://points", "points"),
        UdpSource("udp://:1", "127.0.0.1", 1),
    ],
    ids=lambda source: type(source).__name__,
)
def test_the_message_of_a_lost_connection_has_the_name_once(source, monkeypatch, caplog):
    monkeypatch.setattr(source, "open", lambda: None)  # of the next attempt
    receiver = Receiver(source, Faults(source.name))
    with caplog.at_level(logging.WARNING, logger="asterism"):
        assert receiver.next(0.01) is None
    receiver.close()
    (message,) = caplog.messages
    assert message.startswith(f"{source.name}: the source is not open. It is connected again")
    assert message.count(source.name) == 1


def test_the_message_of_a_closed_connection_has_the_name_once(caplog):
    with qtm_server() as server:
        source = QtmSource("qtm://127.0.0.1", "127.0.0.1", server.port)
        source.open()
        receiver = Receiver(source, Faults(source.name))
    with caplog.at_level(logging.WARNING, logger="asterism"):
        assert receiver.next(5) is None
    receiver.close()
    (message,) = (text for text in caplog.messages if "connected again" in text)
    assert message.startswith("qtm://127.0.0.1: the connection is lost: ")
    assert message.count(source.name) == 1


def test_qtm_is_opened_again_after_a_loss():
    with qtm_server() as server:
        source = QtmSource("qtm", "127.0.0.1", server.port)
        for _ in range(3):
            source.open()
            until(lambda: [c.request is not None for c in server._clients] == [True])
            server.send(FRAMES[0])
            assert source.receive(5).number == 1
        source.close()
        source.close()


def one_answer(answers):
    """A server that sends some bytes at once and others after the request of frames."""
    listener = socket.create_server(("127.0.0.1", 0))

    def run():
        client, _ = listener.accept()
        with client:
            client.sendall(answers[0])
            received = b""
            while b"StreamFrames" not in received and (more := client.recv(4096)):
                received += more
                if b"Version" in more:
                    client.sendall(qtm.encode_text(Packet.COMMAND, "Version set to 1.25"))
                if b"GetParameters" in more:
                    client.sendall(qtm.encode_text(Packet.XML, "<not XML"))
            for answer in answers[1:]:
                client.sendall(answer)
                time.sleep(0.02)
        listener.close()

    thread = threading.Thread(target=run)
    thread.start()
    return listener.getsockname()[1], thread


def test_qtm_counts_garbage_and_goes_on():
    points = encode_positions(Component.POINTS, np.ones((2, 3)), np.arange(2))
    good = qtm.encode_data(1.0, 5, [points])
    bad = qtm.encode_data(1.0, 4, [struct.pack("<II", 999, 2)])
    welcome = qtm.encode_text(Packet.COMMAND, "QTM RT Interface connected")
    port, thread = one_answer([welcome, bad, good[:11], good[11:], struct.pack("<II", 3, 3)])
    source = QtmSource("qtm", "127.0.0.1", port)
    source.open()
    assert source.rate == 0.0
    assert source.receive(5).number == 5
    assert list(source.faults.values()) == [1]
    with pytest.raises(SourceLost, match="a packet of 3 bytes"):
        source.receive(5)
    thread.join()


@pytest.mark.parametrize("welcome", ["Hello", "SSH-2.0"])
def test_qtm_refuses_another_server(welcome):
    port, thread = one_answer([qtm.encode_text(Packet.COMMAND, welcome)])
    source = QtmSource("qtm://127.0.0.1", "127.0.0.1", port)
    with pytest.raises(SourceError, match="expected a Qualisys system"):
        source.open()
    thread.join()


def test_nobody_answers(monkeypatch):
    import asterism.live.sources.natnet as module

    monkeypatch.setattr(module, "_CONNECT_SECONDS", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(SourceError, match="Check that QTM runs"):
        QtmSource("qtm", "127.0.0.1", port).open()
    with pytest.raises(SourceError, match="Check that Motive runs"):
        NatNetSource("natnet", "127.0.0.1", port).open()


@pytest.mark.parametrize("suffix", ["c3d", "csv"])
def test_replay_delivers_the_capture(tmp_path, suffix):
    path = tmp_path / f"cube.{suffix}"
    am.write(am.simulate.cube(frames=50, rate=30, seed=1), path)
    d = am.read(path)
    source = ReplaySource("cube", path, math.inf)
    for _ in range(2):  # it can be played again
        source.open()
        assert source.rate == pytest.approx(30.0)
        for t in range(50):
            found = source.receive(0.0)
            assert (found.number, found.time) == (d.first_frame + t, d.times[t])
            np.testing.assert_array_equal(found.points, d.frame(t))
        with pytest.raises(EndOfSource):
            source.receive(1.0)
        source.close()


def test_replay_keeps_the_time(tmp_path):
    path = tmp_path / "cube.csv"
    am.write(am.simulate.cube(frames=16, rate=30, seed=1), path)
    source = ReplaySource("cube", path, 2.0)
    source.open()
    assert source.receive(0.0) is not None
    assert source.receive(0.001) is None  # the next frame is due after 17 ms
    found = [source.receive(1.0) for _ in range(15)]
    assert found[-1].received - source._begin == pytest.approx(0.25, abs=0.15)
    assert found[-1].received - source._begin >= 0.25


def test_replay_of_what_is_no_capture(tmp_path):
    with pytest.raises(SourceError, match="no such file"):
        ReplaySource("x", tmp_path / "nothing.c3d").open()
    path = tmp_path / "flat.csv"
    am.write(am.Detections.from_frames([0.0], [[[0.0, 1.0]]]), path)
    with pytest.raises(SourceError, match="3-D"):
        ReplaySource("x", path).open()


LINES = [
    {"frame": 1, "time": 0.1, "points": [[0, 1, 2], [3, 4, 5]]},
    {"frame": 2, "time": 0.2, "points": []},
    {"frame": 3, "time": 0.3, "points": [None, [1.5, 2, 3]], "more": "text"},
]
BAD = [
    b"", b"{", b"[]", b"1", b'"text"', b"\xff\xfe", b"[" * 100_000,
    b'{"frame": 1.5, "time": 0, "points": []}', b'{"frame": 1, "time": "now", "points": []}',
    b'{"frame": 1, "time": 0}', b'{"frame": true, "time": 0, "points": []}',
    b'{"frame": 1, "time": 0, "points": [[1, 2]]}', b'{"frame": 1, "time": 0, "points": [7]}',
    b'{"frame": 1, "time": 0, "points": [["a", 2, 3]]}', b'{"frame": 1, "time": NaN, "points": []}',
    b'{"frame": 1, "time": 0, "points": [[' + b"9" * 400 + b", 2, 3]]}",
    b'{"frame": 1e400, "time": 0, "points": []}',
]  # fmt: skip


def test_lines_over_udp():
    source = UdpSource("udp", "127.0.0.1", 0)
    source.open()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", source.port))
        for bad in BAD:
            sender.send(bad[:60_000])
        sender.send("\n".join(json.dumps(line) for line in LINES).encode())
        found = [source.receive(5) for _ in LINES]
    assert [f.number for f in found] == [1, 2, 3]
    assert [f.time for f in found] == [0.1, 0.2, 0.3]
    assert [f.points.tolist() for f in found] == [[[0, 1, 2], [3, 4, 5]], [], [[1.5, 2, 3]]]
    assert sum(source.faults.values()) == len(BAD) - 1  # an empty datagram has no line
    assert source.receive(0.01) is None
    other = UdpSource("udp", "127.0.0.1", source.port)
    with pytest.raises(SourceError, match="cannot listen"):
        other.open()
    source.close()
    with pytest.raises(SourceLost):
        source.receive(0.01)


def test_lines_of_standard_input():
    text = b"\n".join([*BAD, *(json.dumps(line).encode() for line in LINES)]) + b"\n"
    source = StandardInput(io.BytesIO(text))
    source.open()
    assert [source.receive(5).number for _ in LINES] == [1, 2, 3]
    with pytest.raises(EndOfSource):
        source.receive(5)
    assert sum(source.faults.values()) == len(BAD) - 1


def test_addresses():
    assert isinstance(parse_source("-"), StandardInput)
    assert isinstance(parse_source("lsl://a stream?"), LslSource)
    assert parse_source("qtm://10.0.0.1:4000")._address == ("10.0.0.1", 4000)
    assert parse_source("natnet://10.0.0.1?local=10.0.0.2")._address == ("10.0.0.1", 1510)
    assert parse_source("udp://:4000")._address == ("127.0.0.1", 4000)
    assert parse_source("a/b.c3d?speed=max")._path == Path("a/b.c3d")


@pytest.mark.parametrize(
    "text",
    ["qtm://", "natnet://", "lsl://", "udp://host", "http://host", "://", "qtm://host:99999",
     "qtm://host/path", "qtm://host?speed=2", "natnet://host?locals=1", "a.c3d?speed=0",
     "a.c3d?speed=fast", "a.c3d?spede=2", "qtm://me@host"],
)  # fmt: skip
def test_addresses_that_are_none(text):
    with pytest.raises(ParameterError, match="FROM"):
        parse_source(text)


def test_lab_streaming_layer():
    pylsl = pytest.importorskip("pylsl", reason="needs liblsl", exc_type=ImportError)
    name = f"asterism test {time.time_ns()}"
    info = pylsl.StreamInfo(name, "MoCap", 6, 100.0, pylsl.cf_float32, name)
    channels = info.desc().append_child("channels")
    for _ in range(6):
        channels.append_child("channel").append_child_value("unit", "mm")
    outlet = pylsl.StreamOutlet(info)
    source = LslSource("lsl", name)
    source.open()
    assert source.rate == 100.0
    assert outlet.wait_for_consumers(5)
    outlet.push_sample([1000.0, 2000.0, 3000.0, math.nan, math.nan, math.nan], 12.5)
    found = source.receive(5)
    assert (found.number, found.time) == (1, pytest.approx(12.5))
    np.testing.assert_array_equal(found.points, [[1.0, 2.0, 3.0]])
    source.close()
    with pytest.raises(SourceLost):
        source.receive(0.1)
