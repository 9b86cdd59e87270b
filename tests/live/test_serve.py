"""Captures and scenes as streams: what is sent, when, and what the command says."""

from __future__ import annotations

import contextlib
import itertools
import json
import signal
import socket
import subprocess
import sys
import threading

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.errors import ParameterError
from asterism.live import NatNetServer, QtmServer, serve
from asterism.live.protocols import qtm
from asterism.live.protocols.qtm import Packet
from asterism.live.protocols.qtm_components import decode_markers, decode_points
from asterism.live.protocols.qtm_parameters import read_parameters
from asterism.live.sources.natnet import NatNetSource
from asterism.live.sources.qtm import QtmSource
from tests.live.served import Client

WALK = am.simulate.person(frames=60, rate=240, seed=1)


def serving(tracks, server, **options):
    """Serve in a thread; return it once the server listens."""
    listens, sent = threading.Event(), []
    thread = threading.Thread(
        target=lambda: sent.append(serve(tracks, server, begin=listens.set, **options))
    )
    thread.start()
    assert listens.wait(10)
    return thread, sent


def test_labelled_markers_with_their_names():
    corrupted = am.simulate.corrupt(WALK, missing=0.1, clutter=0.1, seed=1)
    server = QtmServer(port=0, discovery_port=0)
    thread, sent = serving(corrupted, server, labelled=True)
    with Client(server.port) as client:
        settings = read_parameters(client.ask("GetParameters General 3D")[1])
        assert settings == (240.0, corrupted.names, ())
        client.send("StreamFrames AllFrames 3D 3DNoLabels")
        positions, d = corrupted.positions(), corrupted.detections
        for t in range(60):
            data = qtm.decode_data(client.next()[1])
            assert (data.number, data.time) == (t + 1, pytest.approx(d.times[t], abs=1e-6))
            markers = decode_markers(data.components[1])
            np.testing.assert_allclose(markers, positions[t], atol=1e-6)
            clutter = d.frame(t)[corrupted.labels[d.offsets[t] : d.offsets[t + 1]] < 0]
            points, _ = decode_points(data.components[2])
            np.testing.assert_allclose(points, clutter, atol=1e-6)
        assert client.next() == (Packet.NO_MORE_DATA, b"")
    thread.join()
    assert sent == [60]


@pytest.mark.parametrize("kind", ["qtm", "natnet"])
def test_points_without_labels(kind):
    server = QtmServer(port=0, discovery_port=0) if kind == "qtm" else NatNetServer(port=0)
    thread, sent = serving(WALK, server)
    source = (QtmSource if kind == "qtm" else NatNetSource)(kind, "127.0.0.1", server.port)
    source.open()
    for t in range(60):
        found = source.receive(5)
        np.testing.assert_allclose(found.points, WALK.detections.frame(t), atol=1e-6)
    source.close()
    thread.join()
    assert (sent, server.names, server.faults) == ([60], (), {})


def test_the_identities_of_points_without_labels_say_nothing():
    server = QtmServer(port=0, discovery_port=0)
    thread, _ = serving(WALK, server)
    with Client(server.port) as client:
        client.send("StreamFrames AllFrames 3DNoLabels")
        ids = [
            decode_points(qtm.decode_data(client.next()[1]).components[2])[1].tolist()
            for _ in range(60)
        ]
    thread.join()
    every = [i for frame in ids for i in frame]
    assert len(set(every)) == len(every) == WALK.detections.n_points


def test_the_clock_does_not_drift():
    server = QtmServer(port=0, discovery_port=0)
    stop = threading.Event()
    thread, sent = serving(WALK, server, loop=True, stop=stop)
    source = QtmSource("qtm", "127.0.0.1", server.port)
    source.open()
    first = source.receive(5)
    n = 480  # eight passes, two seconds
    late = []
    for i in range(1, n):
        found = source.receive(5)
        assert found.number == i + 1  # numbers and times go on from pass to pass
        assert found.time == pytest.approx(i / 240, abs=1e-6)
        late.append(found.received - first.received - found.time)
    stop.set()
    thread.join()
    source.close()
    # Delays of this machine do not add up: some frame near the end is on time again.
    assert min(late[-48:]) < 0.02
    assert min(late) > -0.05
    assert sent[0] >= n


@pytest.mark.parametrize(
    "tracks",
    [am.Tracks.from_dense([0.0], [[[0.0, 1.0]]]), am.Tracks.from_dense([0.0], np.empty((1, 0, 3)))],
)
def test_what_cannot_be_served(tracks):
    with pytest.raises(ParameterError, match="tracks"):
        serve(tracks, QtmServer(port=0, discovery_port=0))


def free_port():
    """A port that is free with the next one."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
            with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port + 1)):
                return port


@pytest.mark.parametrize("protocol", ["qtm", "natnet"])
def test_the_command(tmp_path, protocol):
    truth, port = tmp_path / "truth.csv", free_port()
    command = [
        sys.executable, "-m", "asterism.cli", "serve", "--scene", "person", "--frames", "50",
        "--as", protocol, "--port", str(port), "--corrupt", "missing=0.1", "--corrupt",
        "clutter=0.1", "--truth", str(truth), "--json",
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    first = itertools.takewhile(lambda line: line != "}\n", process.stdout)
    said = json.loads("".join(first) + "}")
    assert said["address"] == f"127.0.0.1:{port}"
    assert said["corruption"] == {"missing": 0.1, "clutter": 0.1, "seed": 0, "keep_unnamed": True}
    known = am.io.read_tracks(truth)
    source = (QtmSource if protocol == "qtm" else NatNetSource)("x", "127.0.0.1", port)
    source.open()
    for t in range(50):
        found = source.receive(5)
        np.testing.assert_allclose(found.points, known.detections.frame(t), atol=1e-6)
    source.close()
    out, errors = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "not free" not in errors
    assert out == ""


def test_an_interrupted_command_ends_cleanly(tmp_path):
    path = tmp_path / "cube.c3d"
    am.write(am.simulate.cube(frames=20, rate=30, seed=1), path)
    command = [sys.executable, "-m", "asterism.cli", "serve", str(path), "--loop", "--labelled"]
    port = free_port()
    process = subprocess.Popen(
        [*command, "--port", str(port)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert str(port) in process.stdout.readline()
    with Client(port) as client:
        client.send("StreamFrames AllFrames 3D")
        assert client.next()[0] == Packet.DATA
        process.send_signal(signal.SIGINT)
        kinds = []
        while (found := client.next()) is not None:
            kinds.append(found[0])
        assert kinds[-3:] == [Packet.NO_MORE_DATA, Packet.EVENT, Packet.EVENT]
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGINT
    assert errors.splitlines()[-1] == "asterism: stopped by SIGINT"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "serve: expected a capture, or a scene by --scene, found none"),
        (["IN", "--scene", "cube"], "serve: expected a capture, or a scene by --scene, found both"),
        (["IN", "--frames", "5"], "CAPTURE: expected no option of a scene, found --frames"),
        (["IN", "--version", "4.0"], "--as qtm: expected no option of NatNet, found --version"),
        (["IN", "--as", "natnet", "--version", "2.9"], "--version: expected one of 3.0"),
        (["IN", "--as", "natnet", "--multicast", "10.0.0.1"], "--multicast: expected a multicast"),
        (["IN", "--host", "example"], "--host: expected an IPv4 address"),
        (["IN", "--corrupt", "missing=2"], "--corrupt missing"),
        (["IN", "--labelled", "--seed", "1"], "--seed: expected --corrupt or --seeing to go"),
        (["IN", "--seeing", "missing=0.1"], "--seeing: expected --rig to go with it"),
        (["IN", "--rig", "ring4", "--as", "natnet"], "--rig: expected --as qtm to go with it"),
        (["nothing.c3d"], "nothing.c3d: no such file"),
    ],
)
def test_arguments_that_do_not_fit(tmp_path, capsys, arguments, message):
    path = tmp_path / "cube.csv"
    am.write(am.simulate.cube(frames=5, seed=1), path)
    code = main(["serve", *[str(path) if a == "IN" else a for a in arguments]])
    assert code == 2
    assert message in capsys.readouterr().err


def test_a_port_in_use(tmp_path, capsys):
    path = tmp_path / "cube.csv"
    am.write(am.simulate.cube(frames=5, seed=1), path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        code = main(["serve", str(path), "--port", str(taken.getsockname()[1])])
    assert code == 2
    assert "Choose another port" in capsys.readouterr().err
