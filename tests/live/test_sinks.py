"""The sinks: what others receive of them."""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError, SinkError
from asterism.live import LiveFrame, StreamHeader
from asterism.live.protocols import qtm
from asterism.live.protocols.qtm import Event, Packet
from asterism.live.protocols.qtm_components import decode_markers, decode_points
from asterism.live.protocols.qtm_parameters import read_parameters
from asterism.live.servers.qtm import QtmServer
from asterism.live.sinks.lsl import LslSink
from asterism.live.sinks.osc import OscSink
from asterism.live.sinks.parse import parse_sink
from asterism.live.sinks.server import ServerSink
from asterism.live.sinks.text import CsvSink, JsonFileSink, JsonUdpSink
from asterism.tracking.methods.states import TrackStates
from tests.live.served import Client
from tests.paths import ROOT

HEADER = StreamHeader(source="test", rate=100.0, names=("A", "B", "C"))


def live_frame(t, names=("B", None, None, "A"), labels=(1, 7, -1, 0)):
    points = np.arange(3.0 * len(labels)).reshape(-1, 3) + t / 8
    return LiveFrame(number=t, time=t / 100, points=points, labels=np.array(labels), names=names)


def states():
    means = np.zeros((2, 3, 2))
    means[1] = np.nan
    return TrackStates(
        ids=np.array([1, 7]), means=means, covariances=np.zeros((2, 2, 2)), gaps=np.array([0, 3]),
        log_odds=np.array([5.0, np.nan]), names=("B", None),
    )  # fmt: skip


def test_servers_keep_every_marker_at_its_place():
    sink = ServerSink("qtm", QtmServer(port=0, discovery_port=0))
    sink.open(HEADER)
    with Client(sink.server.port) as client:
        assert read_parameters(client.ask("GetParameters General 3D")[1]) == (
            100.0,
            HEADER.names,
            (),
        )
        client.send("StreamFrames AllFrames 3D 3DNoLabels")
        assert sink.server.wait_for_client(5)
        frame = live_frame(8)
        sink.send(frame)
        data = qtm.decode_data(client.next()[1])
        assert (data.number, data.time) == (8, 0.08)
        markers = decode_markers(data.components[1])
        np.testing.assert_array_equal(markers, [frame.points[3], frame.points[0], [math.nan] * 3])
        points, ids = decode_points(data.components[2])
        np.testing.assert_array_equal(points, frame.points[1:3])
        assert ids.tolist() == [8, 0]  # its track plus 1, and 0 for clutter
        sink.send(live_frame(9, ("D", "C", None, "A")))
        assert client.next() == (Packet.EVENT, bytes([Event.CAMERA_SETTINGS_CHANGED]))
        markers = decode_markers(qtm.decode_data(client.next()[1]).components[1])
        assert np.isnan(markers[:, 0]).tolist() == [False, True, False, False]
        assert read_parameters(client.ask("GetParameters 3D")[1]).names == ("A", "B", "C", "D")
        sink.close()
        assert client.next() == (Packet.NO_MORE_DATA, b"")
    sink.close()


def test_open_sound_control():
    pytest.importorskip("pythonosc", reason="pip install python-osc")
    from pythonosc.dispatcher import Dispatcher
    from pythonosc.osc_server import BlockingOSCUDPServer

    received = []
    dispatcher = Dispatcher()
    dispatcher.set_default_handler(lambda address, *values: received.append((address, values)))
    with BlockingOSCUDPServer(("127.0.0.1", 0), dispatcher) as server:
        sink = OscSink("osc", *server.server_address)
        sink.open(HEADER)
        frame = live_frame(8, ("B", None, None, "left knee/1"))
        sink.send(frame)
        server.handle_request()
        sink.close()
    assert received == [
        ("/asterism/frame", (8, 0.08)),
        ("/asterism/marker/B", tuple(frame.points[0])),
        ("/asterism/track/7", tuple(frame.points[1])),
        ("/asterism/marker/left_knee_1", tuple(frame.points[3])),
    ]


def test_a_large_frame_is_several_bundles():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**22)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        sink = OscSink("osc", *receiver.getsockname())
        sink.open(HEADER)
        n = 3000
        sink.send(live_frame(1, None, tuple(range(n))))
        packets = [receiver.recv(65536) for _ in range(3)]
        sink.close()
    assert all(p.startswith(b"#bundle\0") and len(p) % 4 == 0 for p in packets)
    assert sum(p.count(b"/asterism/track/") for p in packets) == n
    assert sink.faults == {}


def test_lab_streaming_layer():
    pylsl = pytest.importorskip("pylsl", reason="needs liblsl", exc_type=ImportError)
    name = f"asterism test {time.time_ns()}"
    sink = LslSink("lsl", name)
    with pytest.raises(SinkError, match="a marker set"):
        sink.open(StreamHeader(source="test"))
    sink.open(HEADER)
    found = pylsl.resolve_byprop("name", name, timeout=5)
    inlet = pylsl.StreamInlet(found[0])
    inlet.open_stream(timeout=5)
    channel = inlet.info().desc().child("channels").child("channel")
    assert channel.child_value("label") == "A_X"
    frame = live_frame(8)
    sink.send(frame)
    sample, _ = inlet.pull_sample(timeout=5)
    want = [*frame.points[3], *frame.points[0], *[math.nan] * 3]
    np.testing.assert_array_equal(sample, np.array(want, np.float32))
    inlet.close_stream()
    sink.close()


def test_json_lines_to_a_file_and_over_udp(tmp_path):
    path = tmp_path / "out.jsonl"
    file_sink = JsonFileSink(path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        udp_sink = JsonUdpSink("udp", *receiver.getsockname())
        for sink in (file_sink, udp_sink):
            sink.open(HEADER)
            frame = live_frame(8)
            object.__setattr__(frame, "tracks", states())
            sink.send(frame)
        datagram = receiver.recv(65536)
        udp_sink.close()
    assert path.read_bytes() == datagram  # it is there before the sink is closed
    file_sink.close()
    found = json.loads(datagram)
    assert found == {
        "frame": 8, "time": 0.08, "points": frame.points.tolist(), "labels": [1, 7, -1, 0],
        "names": ["B", None, None, "A"],
        "tracks": {
            "id": [1, 7], "name": ["B", None], "position": [[0, 0, 0], None],
            "seen": [True, False], "velocity": [[0, 0, 0], None],
            "existence": [pytest.approx(0.9933, abs=1e-4), None],
        },
    }  # fmt: skip
    with pytest.raises(SinkError, match="exists already"):
        JsonFileSink(path).open(HEADER)


def test_csv_is_read_again(tmp_path):
    path = tmp_path / "out.csv"
    sink = CsvSink(path)
    sink.open(HEADER)
    frames = [live_frame(t, ("B", 'the "left", knee', None, "A")) for t in (1, 2, 4)]
    for frame in frames:
        sink.send(frame)
    sink.send(live_frame(5, (), ()))
    sink.close()
    tracks = am.io.read_tracks(path)
    assert tracks.detections.times.tolist() == [0.01, 0.02, 0.04, 0.05]
    np.testing.assert_array_equal(tracks.detections.points[:4], frames[0].points)
    assert set(tracks.names) >= {"A", "B", 'the "left", knee'}
    assert (tracks.labels < 0).sum() == 3


def test_standard_output_does_not_wait_for_its_reader():
    code = (
        "import numpy as np, time\n"
        "from asterism.live import LiveFrame, StreamHeader\n"
        "from asterism.live.sinks.parse import parse_sink\n"
        "sink = parse_sink('-'); sink.open(StreamHeader(source='x'))\n"
        "frame = LiveFrame(number=1, time=0.0, points=np.ones((100, 3)), labels=np.arange(100))\n"
        "begin = time.perf_counter()\n"
        "for _ in range(1000): sink.send(frame)\n"
        "took = time.perf_counter() - begin\n"
        "import sys; sys.stderr.write(f'{took} {sink.faults}\\n'); sys.stderr.flush()\n"
        "import os; os._exit(0)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT
    )
    assert process.stderr is not None  # nothing reads standard output
    took, faults = process.stderr.read().decode().split(maxsplit=1)
    process.communicate()
    assert float(took) < 5
    assert "slow reader" in faults


def test_standard_output_has_whole_lines():
    code = (
        "import numpy as np\n"
        "from asterism.live import LiveFrame, StreamHeader\n"
        "from asterism.live.sinks.parse import parse_sink\n"
        "sink = parse_sink('-'); sink.open(StreamHeader(source='x'))\n"
        "for i in range(50): sink.send(LiveFrame("
        "number=i, time=0.0, points=np.ones((9, 3)), labels=np.arange(9)))\n"
        "sink.close()\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=ROOT, check=True)
    assert [json.loads(line)["frame"] for line in out.stdout.splitlines()] == list(range(50))


def test_a_full_disk_is_counted(tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    sink = JsonFileSink(tmp_path / "out.jsonl")
    sink.open(HEADER)
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, sink._file)
    os.close(full)
    sink.send(live_frame(1))
    assert sink.faults == {"not written: No space left on device": 1}
    sink.close()


def test_sinks_are_used_by_several_threads_one_after_the_other(tmp_path):
    sink = JsonFileSink(tmp_path / "out.jsonl")
    sink.open(HEADER)
    thread = threading.Thread(target=sink.send, args=[live_frame(1)])
    thread.start()
    thread.join()
    sink.close()
    sink.close()
    sink.send(live_frame(2))  # after the end it has no effect
    assert len((tmp_path / "out.jsonl").read_bytes().splitlines()) == 1


@pytest.mark.parametrize(
    "text",
    ["osc://:9000", "osc://host", "udp://host", "lsl://", "out.trc", "ftp://x", "qtm://:70000",
     "natnet://:1510?version=four", "natnet://:1510?version=2.9", "qtm://:1?version=1",
     "qtm://me.org"],
)  # fmt: skip
def test_addresses_that_are_none(text):
    with pytest.raises(ParameterError):
        parse_sink(text)


def test_addresses(tmp_path):
    assert parse_sink("qtm://").server.port == 22223
    assert parse_sink("natnet://0.0.0.0:15?version=3.1").server.host == "0.0.0.0"
    assert parse_sink("osc://127.0.0.1:9000")._target == ("127.0.0.1", 9000)
    assert parse_sink("out.c3d").name == "out.c3d"
    with pytest.raises(SinkError, match="cannot be written"):
        parse_sink(str(tmp_path / "no folder" / "x.jsonl")).open(HEADER)
