"""Packets that Motive sent, decoded as its maker's own client decoded them."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.live.protocols.natnet import OCCLUDED, Message, decode_frame, decode_message
from asterism.live.protocols.natnet_messages import (
    decode_marker_sets,
    decode_server_info,
    encode_echo,
    wanted_version,
)
from asterism.live.sources.natnet import points_of
from tests.live.traffic import datagrams, printed_frames
from tests.paths import STREAMS

FOLDER = STREAMS / "mje-nz__python_natnet"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"{FOLDER} is not here")


def assert_printed(values, texts):
    """Numbers agree with their two printed digits; halves are rounded to either side."""
    texts = np.array(texts, dtype=np.float64).reshape(np.shape(values))
    np.testing.assert_allclose(texts, values, rtol=0, atol=0.005 + 1e-9)


def body_of(name):
    return decode_message((FOLDER / f"{name}_v3.bin").read_bytes())


def test_session_decodes_to_what_the_sample_client_printed():
    frames = {}
    for packet in datagrams((FOLDER / "raw" / "traffic.pcapng").read_bytes()):
        kind, body = decode_message(packet)
        if kind == Message.FRAME:
            frame = decode_frame(body, (3, 0))
            frames[frame.number] = frame
    printed = printed_frames((FOLDER / "raw" / "SampleClient_output.txt").read_text())
    assert len(printed) == 251
    assert printed.keys() <= frames.keys()
    for number, want in printed.items():
        frame = frames[number]
        assert_printed(frame.time, want["time"])
        assert len(frame.others) == want["n_others"] == len(want["others"])
        assert_printed(frame.others, want["others"])
        bodies, m = frame.bodies, frame.labelled
        assert [int(b[0]) for b in want["bodies"]] == bodies["id"].tolist()
        assert [int(b[2]) for b in want["bodies"]] == (bodies["flags"] & 1).tolist()
        assert_printed(bodies["error"], [b[1] for b in want["bodies"]])
        assert_printed(np.hstack([bodies["place"], bodies["rotation"]]), want["poses"])
        ids, flags = m["id"], m["flags"]
        stated = [ids >> 16, ids & 0xFFFF, flags & 1, flags >> 1 & 1, flags >> 2 & 1]
        assert np.array([row[:5] for row in want["labelled"]], int).T.tolist() == [
            column.tolist() for column in stated
        ]
        assert_printed(m["size"], [row[5] for row in want["labelled"]])
        assert_printed(m["place"], [row[6:] for row in want["labelled"]])
        assert (frame.n_skeletons, frame.n_force_plates, frame.n_devices) == (
            want["n_skeletons"], want["n_plates"], want["n_devices"],
        )  # fmt: skip


def test_server_and_client_of_the_session():
    kind, body = body_of("serverinfo_packet")
    assert kind == Message.SERVER_INFO
    info = decode_server_info(body)
    assert (info.application, info.version) == ("Motive", (3, 0))
    assert (info.data_port, info.multicast, info.clock_rate) == (1511, "239.255.42.99", 3312787)
    assert wanted_version(body_of("connect_packet")[1]) == (3, 0)
    assert body_of("discovery_packet")[0] == Message.DISCOVERY


def test_model_definitions_of_the_session():
    sets = decode_marker_sets(body_of("modeldef_packet")[1], (3, 0))
    assert sets["RaceQuad"] == tuple(f"Marker{i}" for i in range(1, 6))
    assert sets["all"] == tuple(f"RaceQuad_{i}" for i in range(1, 6))


def test_echo_repeats_the_time_of_the_client():
    request, answer = body_of("echorequest_packet")[1], body_of("echoresponse_packet")[1]
    made = encode_echo(request, int.from_bytes(answer[8:16], "little"))
    assert made == (FOLDER / "echoresponse_packet_v3.bin").read_bytes()


def test_occluded_markers_are_no_points():
    frame = decode_frame(body_of("mocapframe_packet_occluded")[1], (3, 0))
    assert len(frame.marker_sets["FakeTree"]) == 5
    assert len(frame.labelled["id"]) == 4
    is_occluded = frame.labelled["flags"] & OCCLUDED > 0
    assert is_occluded.tolist() == [True, False, False, False]
    np.testing.assert_array_equal(points_of(frame), frame.labelled["place"][~is_occluded])
    seen = decode_frame(body_of("mocapframe_packet")[1], (3, 0))
    np.testing.assert_allclose(points_of(seen)[:5], seen.others, atol=1e-6)
    assert points_of(seen).shape == (6, 3)
