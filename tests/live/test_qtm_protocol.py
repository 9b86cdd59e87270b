"""Packets of the Qualisys protocol: what is encoded is decoded; garbage raises one error only."""

from __future__ import annotations

import contextlib
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import asterism as am
from asterism.live.protocols import qtm
from asterism.live.protocols.packet_error import PacketError
from asterism.live.protocols.qtm import Event, Packet
from asterism.live.protocols.qtm_commands import read_components, read_stream_request
from asterism.live.protocols.qtm_components import (
    Component,
    decode_2d,
    decode_markers,
    decode_points,
    encode_2d,
    encode_nothing,
    encode_positions,
)
from asterism.live.protocols.qtm_parameters import (
    SECTIONS,
    encode_parameters,
    read_calibration,
    read_parameters,
)

ORDERS = st.sampled_from("<>")
# Coordinates that millimetres hold exactly in 32 bits.
PLACES = st.integers(0, 40).flatmap(
    lambda n: arrays(np.float64, (n, 3), elements=st.integers(-(2**23), 2**23).map(float))
).map(lambda a: a / 1000)  # fmt: skip


@given(PLACES, ORDERS, st.booleans(), st.integers(0, 2**32 - 1), st.data())
def test_frames_are_decoded_as_they_were_encoded(places, order, residuals, number, data):
    missing = data.draw(arrays(np.bool_, len(places)))
    markers = np.where(missing[:, None], np.nan, places)
    ids = data.draw(arrays(np.int64, len(places), elements=st.integers(0, 2**32 - 1)))
    at = (
        (Component.MARKERS_RESIDUAL, Component.POINTS_RESIDUAL)
        if residuals
        else (Component.MARKERS, Component.POINTS)
    )
    parts = [
        encode_positions(at[0], markers, order=order),
        encode_positions(at[1], places, ids, order),
        encode_nothing(Component.SKELETON, order),
    ]
    packet = bytearray(qtm.encode_data(12.5, number, parts, order))
    kind, body = qtm.split(packet, order)
    assert kind == Packet.DATA
    found = qtm.decode_data(body, order)
    assert (found.time, found.number, len(found.components)) == (12.5, number, 3)
    got = decode_markers(found.components[at[0]], residuals=residuals, order=order)
    np.testing.assert_array_equal(got, markers)
    got, got_ids = decode_points(found.components[at[1]], residuals=residuals, order=order)
    np.testing.assert_array_equal(got, places)
    np.testing.assert_array_equal(got_ids, ids)


def test_missing_markers_have_all_bits_set():
    # Clients compare the 32 bits; another NaN would be a marker to them.
    markers = np.array([[np.nan] * 3, [1.0, 2.0, 3.0]])
    packet = encode_positions(Component.MARKERS, markers)
    assert packet[16:28] == b"\xff" * 12
    assert struct.unpack("<3f", packet[28:40]) == (1000.0, 2000.0, 3000.0)


@given(st.binary(max_size=200), ORDERS)
def test_garbage_raises_only_the_error_of_packets(data, order):
    readers = (
        qtm.decode_data, decode_markers, decode_points, decode_2d,
    )  # fmt: skip
    for read in readers:
        with contextlib.suppress(PacketError):
            read(data, order=order)
    with contextlib.suppress(PacketError):
        qtm.split(bytearray(data), order)
    with contextlib.suppress(PacketError):
        qtm.decode_discovery(data)
    with contextlib.suppress(PacketError):
        read_parameters(qtm.text_of(data))
    with contextlib.suppress(PacketError):
        read_stream_request(qtm.text_of(data).split())


@given(st.integers(0, 10**6), st.integers(0, 10**6))
def test_truncated_and_altered_packets(cut, change):
    parts = [
        encode_positions(Component.POINTS, np.ones((5, 3)), np.arange(5)),
        encode_positions(Component.MARKERS, np.ones((4, 3))),
    ]
    body = qtm.encode_data(1.0, 7, parts)[8:]
    with pytest.raises(PacketError):
        qtm.decode_data(body[: cut % len(body)])
    altered = bytearray(body)
    altered[change % len(body)] ^= 0xFF
    with contextlib.suppress(PacketError):
        for kind, part in qtm.decode_data(altered).components.items():
            read = decode_markers if kind == Component.MARKERS else decode_points
            read(part)


def test_image_points_of_cameras():
    camera = struct.pack("<Ib", 2, 0) + struct.pack("<iihhiihh", 64, -128, 5, 6, 1, 2, 3, 4)
    cameras = decode_2d(struct.pack("<IHH", 2, 0, 0) + camera + struct.pack("<Ib", 0, 1))
    assert [c.tolist() for c in cameras] == [[[1, -2], [1 / 64, 2 / 64]], []]


@pytest.mark.parametrize("order", ["<", ">"])
def test_image_points_are_decoded_as_they_were_encoded(order):
    cameras = [np.array([[10.25, 700.5], [-0.5, 3.009]]), np.empty((0, 2)), np.array([[1.0, 2.0]])]
    packet = encode_2d(cameras, order)
    assert struct.unpack_from(f"{order}II", packet) == (len(packet), Component.IMAGE_POINTS)
    for got, want in zip(decode_2d(packet[8:], order), cameras, strict=True):
        np.testing.assert_array_equal(got, np.rint(want * 64) / 64)
    with pytest.raises(PacketError):
        decode_2d(packet[8:-1], order)


def test_a_calibration_survives_the_settings():
    lens = am.camera.BrownConrady(-0.1, 0.02, 1e-3, -1e-3, 0.01)
    rig = am.Rig(tuple(replace(c, lens=lens) for c in am.Rig.ring(3, radius=3, height=2)))
    text = encode_parameters(("general", "calibration"), "1.25", names=(), rate=100.0, rig=rig)
    assert read_parameters(text) == (100.0, (), rig.names)
    found = read_calibration(text)
    assert found.names == rig.names
    points = np.random.default_rng(1).uniform(-1, 1, (20, 3))
    want = rig.project(points).pixels
    np.testing.assert_allclose(found.project(points).pixels, want, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<a/>", "without a calibration"),
        ("<a><calibration/></a>", "its cameras"),
        ("<a><calibration><cameras><camera/></cameras></calibration></a>", "camera 1"),
        ("<a", "cannot be read"),
    ],
)
def test_settings_without_a_calibration(text, reason):
    with pytest.raises(PacketError, match=reason):
        read_calibration(text)


def test_packets_are_split_wherever_they_are_cut():
    packets = [qtm.encode_text(Packet.COMMAND, "version 1.25"), qtm.encode_event(Event.CONNECTED)]
    stream, buffer, found = b"".join(packets), bytearray(), []
    for byte in stream:
        buffer.append(byte)
        while (one := qtm.split(buffer)) is not None:
            kind, body = one
            found.append((kind, bytes(body)))
            size = len(body) + 8
            body.release()
            del buffer[:size]
    assert found == [(1, b"version 1.25\0"), (6, b"\x01")]


@pytest.mark.parametrize(("size", "kind"), [(0, 1), (7, 1), (2**31, 1), (100, 9), (100, 2**30)])
def test_a_lost_boundary_of_packets_is_noticed(size, kind):
    with pytest.raises(PacketError):
        qtm.split(bytearray(struct.pack("<II", size, kind)))


@given(st.lists(st.text(st.characters(codec="utf-8"), min_size=1)))
def test_names_survive_the_settings(names):
    text = encode_parameters(SECTIONS, "1.25", names=tuple(names), rate=240.0)
    kept = tuple("".join(c for c in n if " " <= c < "\ufffe" or c > "\uffff") for n in names)
    assert read_parameters(text) == (240.0, kept, ())


def test_settings_with_entities_are_refused():
    with pytest.raises(PacketError):
        read_parameters('<!DOCTYPE a [<!ENTITY b "b">]><a>&b;</a>')


@pytest.mark.parametrize(
    ("words", "want"),
    [
        ("AllFrames 3D", ((Component.MARKERS,), 1, 0, None)),
        ("allframes 3DRes 3dnolabels", ((9, 2), 1, 0, None)),
        ("FrequencyDivisor:4 UDP:127.0.0.1:5000 3D", ((1,), 4, 0, ("127.0.0.1", 5000))),
        ("Frequency:30 UDP:2234 3D Analog:1,2", ((1, 3), 1, 30, ("", 2234))),
    ],
)
def test_requests_of_frames(words, want):
    assert read_stream_request(words.split()) == want


@pytest.mark.parametrize(
    "words",
    ["", "3D", "AllFrames", "AllFrames 4D", "Frequency:0 3D", "Frequency:-1 3D", "Frequency: 3D",
     "AllFrames UDP:80 3D", "AllFrames UDP:host:5000 3D", "AllFrames UDP:70000 3D",
     "FrequencyDivisor:9999999 3D"],
)  # fmt: skip
def test_requests_that_make_no_sense(words):
    with pytest.raises(PacketError):
        read_stream_request(words.split())


def test_all_components():
    assert len(read_components(["All"])) == 19
