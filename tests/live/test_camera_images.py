"""Image points of a Qualisys system: served from a scene, and reconstructed by the source."""

from __future__ import annotations

import asyncio
import dataclasses
import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

import asterism as am
from asterism.camera import Observations
from asterism.errors import FormatError, ParameterError, SourceError
from asterism.live import NatNetServer, QtmServer, ServedFrame, serve
from asterism.live.sources.camera_images import FIRST
from asterism.live.sources.parse import parse_source
from asterism.simulate.rig_presets import place_preset
from asterism.tracking import Stitched
from tests.live.served import qtm_server, until
from tests.live.sources import Kept, Memory
from tests.live.test_serve import free_port, serving

NOISE = 0.2  # pixels


@pytest.fixture(scope="module")
def filmed():
    """A person, six cameras around him, and their image points as the protocol rounds them."""
    truth = am.simulate.person(frames=120, rate=100, seed=3)
    points = truth.detections.points
    rig, _ = place_preset("ring6", points.min(axis=0), points.max(axis=0))
    seeing = am.simulate.Seeing(noise_px=NOISE, missing=0.02, false=0.1)
    seen = am.simulate.film(truth, rig, seeing=seeing, seed=3).observations
    return truth, rig, dataclasses.replace(seen, pixels=np.rint(seen.pixels * 64) / 64)


def images_of(seen, t):
    return [seen.points(t, c) for c in range(seen.n_cameras)]


def frame_of(number, images):
    none = np.empty((0, 3))
    ids = np.empty(0, dtype=np.int64)
    time = number / 100
    return ServedFrame(number=number, time=time, markers=none, points=none, ids=ids, images=images)


def received(server, frames, options="?2d"):
    """Send frames as fast as the source takes them; return the source and what it delivers."""
    source = parse_source(f"qtm://127.0.0.1:{server.port}{options}")
    source.open()
    until(lambda: any(c.request for c in server._clients))
    found = []
    for frame in frames:
        server.send(frame)
        until(lambda: not any(c.pending for c in server._clients), 20)
        if (one := source.receive(0.0)) is not None:
            found.append(one)
    while (one := source.receive(0.5)) is not None:
        found.append(one)
    source.close()
    assert server.faults == {}
    return source, found


def offline(seen, rig):
    """Points of a recording by the model of its first frames."""
    n = FIRST * seen.n_cameras
    first = Observations(
        times=seen.times[:FIRST], cameras=seen.cameras, offsets=seen.offsets[: n + 1],
        pixels=seen.pixels[: seen.offsets[n]],
    )  # fmt: skip
    model = dataclasses.replace(am.multiview.estimate_images(first, rig), volume=None)
    return am.reconstruct(seen, rig, model).detections


def test_points_and_identities_are_those_of_the_recording(filmed):
    truth, rig, seen = filmed
    with qtm_server(names=(), rig=rig) as server:
        _, found = received(server, [frame_of(t, images_of(seen, t)) for t in range(120)])
    assert [f.number for f in found] == list(range(120))
    recorded = offline(seen, rig)
    for t, frame in enumerate(found):
        rows = slice(recorded.offsets[t], recorded.offsets[t + 1])
        np.testing.assert_allclose(frame.points, recorded.points[rows], rtol=0, atol=1e-8)
        covariances = recorded.covariances[rows]
        np.testing.assert_allclose(frame.covariances, covariances, rtol=1e-5, atol=1e-12)

    sink, method = Kept(), Stitched()
    model = am.estimate_model(recorded).model
    am.live.run(Memory(found), [sink], model=model, method=method)
    state, labels = method.init(model), []
    for t, frame in enumerate(found):
        rows = slice(recorded.offsets[t], recorded.offsets[t + 1])
        state, update = method.step(
            state, frame.time, recorded.points[rows], covariances=recorded.covariances[rows]
        )
        labels.append(update.labels)
    for frame, want in zip(sink.frames, labels, strict=True):
        np.testing.assert_array_equal(frame.labels, want)

    # The distances from the true points are those that the covariances state.
    positions, squares = truth.positions(), []
    for frame in found:
        places = positions[frame.number]
        away = frame.points[:, None] - places[np.isfinite(places[:, 0])]
        nearest = np.linalg.norm(away, axis=2).argmin(axis=1)
        off = away[np.arange(len(away)), nearest]
        squares.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(frame.covariances), off))
    squares = np.concatenate(squares)
    assert len(squares) > 0.98 * truth.detections.n_points
    assert np.quantile(squares, 0.5) == pytest.approx(2.366, rel=0.15)  # of chi² with 3
    # 99.9 % of chi² with 3; merged and partly occluded image points lie off by more.
    assert np.mean(squares < 16.27) > 0.95


def test_frames_before_the_first_marker_are_delivered_at_once(filmed):
    _, rig, seen = filmed
    empty = [np.empty((0, 2))] * 6
    with qtm_server(names=(), rig=rig) as server:
        source = parse_source(f"qtm://127.0.0.1:{server.port}?2d")
        source.open()
        until(lambda: any(c.request for c in server._clients))
        server.send(frame_of(0, empty))
        assert source.receive(5).points.shape == (0, 3)
        server.send(frame_of(1, images_of(seen, 1)))
        assert source.receive(0.1) is None  # the model is not there yet
        source.close()


def test_a_calibration_from_a_file_and_a_camera_without_one(filmed, tmp_path):
    _, rig, seen = filmed
    am.io.write_rig(am.Rig(rig.cameras[1:]), tmp_path / "five.toml")
    frames = [frame_of(t, images_of(seen, t)) for t in range(30)]
    with qtm_server(names=(), rig=rig) as server:
        _, found = received(server, frames, f"?2d={tmp_path}/five.toml")
    counts = np.diff(seen.offsets).reshape(-1, 6)
    assert [f.number for f in found] == list(range(30))
    assert np.mean([len(f.points) for f in found]) > 0.9 * counts[:30, 1:].max(axis=1).mean()
    with pytest.raises(FormatError, match=r"none\.toml: no such file"):
        parse_source("qtm://127.0.0.1?2d=none.toml")


def test_a_calibration_that_is_missing_or_of_other_cameras(filmed, tmp_path):
    _, rig, _ = filmed
    others = [dataclasses.replace(c, name=f"x{i}") for i, c in enumerate(rig)]
    am.io.write_rig(am.Rig(tuple(others)), tmp_path / "others.toml")
    with qtm_server() as server:
        source = parse_source(f"qtm://127.0.0.1:{server.port}?2d")
        with pytest.raises(SourceError, match=r"has no calibration.*Calibrate it in QTM, or give"):
            source.open()
    with qtm_server(rig=rig) as server:
        source = parse_source(f"qtm://127.0.0.1:{server.port}?2d={tmp_path}/others.toml")
        with pytest.raises(SourceError, match=r"\(x0, .*found cameras cam1, .*by serial number"):
            source.open()


def test_frames_of_another_number_of_cameras_are_counted(filmed):
    _, rig, seen = filmed
    frames = [frame_of(t, images_of(seen, t)) for t in range(30)]
    frames[10] = frame_of(10, images_of(seen, 10)[:5])
    with qtm_server(names=(), rig=rig) as server:
        source, found = received(server, frames)
    assert [f.number for f in found] == [t for t in range(30) if t != 10]
    assert source.faults == {"undecoded": 1}


def test_what_cannot_be_served(filmed):
    truth, rig, seen = filmed
    with pytest.raises(ParameterError, match=r"observations: .*a QtmServer with a rig"):
        serve(truth, NatNetServer(port=0), observations=seen)
    with pytest.raises(ParameterError, match=r"observations: .*a QtmServer with a rig"):
        serve(truth, QtmServer(port=0, discovery_port=0), observations=seen)
    server = QtmServer(port=0, discovery_port=0, rig=rig)
    with pytest.raises(ParameterError, match="100 frames, found 120"):
        serve(truth.part(0, 100), server, observations=seen)
    bent = dataclasses.replace(rig[0], lens=am.camera.ViconRadial(k1=1e-8))
    with pytest.raises(ParameterError, match="lens of camera"):
        QtmServer(port=0, discovery_port=0, rig=am.Rig((bent, *rig.cameras[1:])))


def test_served_image_points_say_nothing_of_their_markers(filmed):
    truth, rig, seen = filmed
    qtm_rt = pytest.importorskip("qtm_rt", reason="pip install qtm-rt")
    got = []

    async def receive(port):
        client = await qtm_rt.connect("127.0.0.1", port=port, version="1.25")
        transport = client._protocol.transport
        await client.stream_frames(components=["2d"], on_packet=got.append)
        while len(got) < 120:
            await asyncio.sleep(0.01)
        transport.close()  # the client leaves its socket open when the server ends
        await asyncio.sleep(0)

    server = QtmServer(port=0, discovery_port=0, rig=rig)
    thread, _ = serving(truth, server, observations=seen)
    asyncio.run(asyncio.wait_for(receive(server.port), 60))
    thread.join()
    for t, packet in enumerate(got):
        for c, points in enumerate(packet.get_2d_markers()[1]):
            pixels = np.array([[p.x, p.y] for p in points]).reshape(-1, 2) / 64
            want = seen.points(t, c)
            np.testing.assert_array_equal(pixels, want[np.lexsort(want.T)])


def test_the_command():
    port = free_port()
    command = [
        sys.executable, "-m", "asterism.cli", "serve", "--scene", "person", "--frames", "60",
        "--rate", "20", "--port", str(port), "--rig", "ring6", "--seeing", "noise_px=0.1", "--json",
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    first = itertools.takewhile(lambda line: line != "}\n", process.stdout)
    said = json.loads("".join(first) + "}")
    assert said["rig"].startswith("6 cameras")
    source = parse_source(f"qtm://127.0.0.1:{port}?2d")
    source.open()
    assert source.rate == 20.0
    truth = am.simulate.person(frames=60, rate=20, seed=0).positions()
    for t in range(60):
        found = source.receive(30)
        assert found.number == t + 1
        away = np.linalg.norm(found.points[:, None] - truth[t], axis=2)
        assert np.nanmedian(np.nanmin(away, axis=1)) < 2e-3
    source.close()
    process.communicate(timeout=30)
    assert process.returncode == 0
