"""Independent clients receive what our servers send, in every version that they speak."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
import threading

import numpy as np
import pytest

from asterism.live.servers.natnet import GROUP
from tests.live.served import NAMES, natnet_server, qtm_server, served_frames, until
from tests.paths import ROOT

FRAMES = list(served_frames(300))
IN_FLIGHT = 20  # frames that a client may be behind; UDP would lose them otherwise


def millimetres(places):
    return (places * 1000).astype(np.float32)


def pump(server, received):
    """Send all frames, not far ahead of the client."""
    for i, frame in enumerate(FRAMES):
        server.send(frame)
        until(lambda i=i: len(received) > i - IN_FLIGHT, 20)


@pytest.mark.parametrize(
    "version", ["1.19", "1.22", "1.23", "1.24", "1.25", "1.26", "1.27", "1.28"]
)
def test_qtm_rt(version):
    qtm_rt = pytest.importorskip("qtm_rt", reason="pip install qtm-rt")
    received = []

    async def receive(port):
        client = await qtm_rt.connect("127.0.0.1", port=port, version=version)
        assert (await client.qtm_version()).startswith(b"QTM Version is")
        assert b"little" in await client.byte_order()
        assert await client.get_state() == qtm_rt.QRTEvent.EventConnected
        settings = await client.get_parameters(["general", "3d"])
        assert settings.count(b"<Label>") == 60
        with pytest.raises(qtm_rt.QRTCommandException, match="Client control disabled"):
            await client.take_control("password")
        components = ["3d", "3dres", "3dnolabels", "3dnolabelsres", "6deuler"]
        await client.stream_frames(components=components, on_packet=received.append)
        while len(received) < len(FRAMES):
            await asyncio.sleep(0.01)
        await client.stream_frames_stop()
        client.disconnect()
        await asyncio.sleep(0)

    with qtm_server() as server:
        thread = threading.Thread(
            target=lambda: server.wait_for_client(20) and pump(server, received)
        )
        thread.start()
        asyncio.run(asyncio.wait_for(receive(server.port), 60))
        thread.join()
        assert server.faults == {}
    for frame, packet in zip(FRAMES, received, strict=True):
        assert packet.framenumber == frame.number
        assert packet.timestamp == round(frame.time * 1e6)
        markers, points = millimetres(frame.markers), millimetres(frame.points)
        got = np.array(packet.get_3d_markers()[1], np.float32)
        np.testing.assert_array_equal(got, markers)
        got = np.array(packet.get_3d_markers_residual()[1], np.float32)
        np.testing.assert_array_equal(got[:, :3], markers)
        got = np.array(packet.get_3d_markers_no_label()[1])
        np.testing.assert_array_equal(got[:, :3].astype(np.float32), points)
        np.testing.assert_array_equal(got[:, 3], frame.ids)
        assert packet.get_6d_euler()[1] == []


def test_qtm_rt_is_refused_another_version(monkeypatch):
    qtm_rt = pytest.importorskip("qtm_rt", reason="pip install qtm-rt")
    protocol, transports = qtm_rt.protocol.QTMProtocol, []
    made = protocol.connection_made

    def noted(self, transport):
        transports.append(transport)
        made(self, transport)

    monkeypatch.setattr(protocol, "connection_made", noted)

    async def connect(port):
        client = await qtm_rt.connect("127.0.0.1", port=port, version="1.40")
        transports[0].close()  # the client leaves its socket open
        await asyncio.sleep(0.01)
        return client

    with qtm_server() as server:
        assert asyncio.run(connect(server.port)) is None


@pytest.mark.parametrize("version", ["1.19", "1.25"])
def test_qualisys_rt_in_javascript(version):
    folder = ROOT / "build" / "node"
    if shutil.which("node") is None or not (folder / "node_modules" / "qualisys-rt").is_dir():
        pytest.skip("needs Node.js, and: npm install --prefix build/node qualisys-rt")
    with qtm_server() as server:
        script = ROOT / "tests" / "live" / "qualisys_rt_client.js"
        command = ["node", script, folder, str(server.port), str(len(FRAMES)), version]
        client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert server.wait_for_client(30)
        for frame in FRAMES:
            server.send(frame)
            until(lambda: not any(c.pending for c in server._clients), 20)
        out, _ = client.communicate(timeout=30)
        assert (client.returncode, server.faults) == (0, {})
    found = json.loads(out)
    assert found["state"] == {"id": 1, "name": "Connected"}
    assert len(found["settings"]["the3d"]["labels"]) == 60
    for frame, got in zip(FRAMES, found["frames"], strict=True):
        assert got["frame"] == frame.number
        markers = [[m["x"], m["y"], m["z"]] for m in got["components"]["3d"]["markers"]]
        # JSON has null where a marker is missing.
        markers = np.array(markers, np.float64).astype(np.float32)
        np.testing.assert_array_equal(markers, millimetres(frame.markers))
        points = got["components"]["3dNoLabels"]["markers"]
        places = np.array([[p["x"], p["y"], p["z"]] for p in points], np.float32)
        np.testing.assert_array_equal(places, millimetres(frame.points))
        assert [p["id"] for p in points] == frame.ids.tolist()


def test_the_vendors_sdk_in_motioncapture():
    pytest.importorskip("motioncapture", reason="pip install motioncapture")
    # It holds the interpreter's lock while it connects, and knows only the usual port.
    code = (
        "import motioncapture\n"
        "mocap = motioncapture.connect('qualisys', {'hostname': '127.0.0.1'})\n"
        "print('connected', flush=True)\n"
        "for _ in range(100):\n"
        "    mocap.waitForNextFrame()\n"
        "print(len(mocap.rigidBodies))\n"
    )
    from asterism.errors import SinkError

    try:
        with qtm_server(port=22223) as server:
            client = subprocess.Popen(
                [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
            )
            assert server.wait_for_client(30)
            for i in range(20):
                for frame in FRAMES:
                    server.send(frame)
                    if client.poll() is not None:
                        break
                    threading.Event().wait(0.002)
                if client.poll() is not None or i == 19:
                    break
            out, _ = client.communicate(timeout=30)
            assert (client.returncode, out.split()) == (0, ["connected", "0"])
    except SinkError as error:
        pytest.skip(f"the usual port is in use: {error}")


@pytest.mark.parametrize("multicast", ["", GROUP])
@pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 0), (4, 1)])
def test_natnet(version, multicast):
    natnet = pytest.importorskip("natnet", reason="pip install natnet")
    received, definitions = [], []
    with natnet_server(version=version, multicast=multicast, data_port=15_111) as server:
        client = natnet.NatNetClient(
            command_port=server.port, data_port=15_111, use_multicast=bool(multicast)
        )
        client.on_data_frame_received_event.handlers.append(received.append)
        client.on_data_description_received_event.handlers.append(definitions.append)
        client.connect()
        client.run_async()
        client.request_modeldef()
        until(lambda: definitions)
        pump(server, received)
        until(lambda: len(received) == len(FRAMES))
        client.shutdown()
        assert server.faults == {}
    assert definitions[0].marker_sets[0].marker_names == NAMES
    for frame, found in zip(FRAMES, received, strict=True):
        assert (found.prefix.frame_number, found.suffix.timestamp) == (frame.number, frame.time)
        got = np.array(found.marker_sets[0].marker_pos_list, np.float32)
        np.testing.assert_array_equal(got, frame.markers.astype(np.float32))
        points = frame.points.astype(np.float32)
        np.testing.assert_array_equal(np.array(found.unlabeled_marker_pos, np.float32), points)
        others = [m for m in found.labeled_markers if m.unlabeled]
        np.testing.assert_array_equal(np.array([m.pos for m in others], np.float32), points)
        assert [m.id_num for m in others] == frame.ids.tolist()
        markers = {m.marker_id - 1: m.pos for m in found.labeled_markers if not m.unlabeled}
        seen = np.flatnonzero(np.isfinite(frame.markers[:, 0]))
        assert sorted(markers) == seen.tolist()


@pytest.mark.parametrize("version", ["3.0", "3.1", "4.0", "4.1"])
def test_the_vendors_python_client(version, tmp_path):
    pytest.importorskip("natnetsdk", reason="pip install natnetsdk")
    # Its threads end only with the process.
    major, minor = map(int, version.split("."))
    with natnet_server(version=(major, minor)) as server:
        out = tmp_path / "frames.npz"
        command = [sys.executable, "-m", "tests.live.natnetsdk_client", str(server.port), str(out)]
        client = subprocess.Popen(
            [*command, str(len(FRAMES))], cwd=ROOT, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert server.wait_for_client(30)
        assert client.stdout is not None
        assert client.stdout.readline().strip() == version
        for frame in FRAMES:
            server.send(frame)
            assert client.stdout.readline().strip() == str(frame.number)
        client.communicate(timeout=30)
        assert client.returncode == 0
    found = np.load(out)
    markers = np.array([frame.markers for frame in FRAMES], np.float32)
    np.testing.assert_array_equal(found["markers"], markers)
    np.testing.assert_array_equal(found["times"], [frame.time for frame in FRAMES])
    points = np.array([frame.points for frame in FRAMES], np.float32)
    np.testing.assert_array_equal(found["others"], points)
