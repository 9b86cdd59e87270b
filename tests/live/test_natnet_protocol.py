"""Packets of NatNet: what is encoded is decoded, and garbage raises one error only."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from asterism.live.protocols.natnet import (
    HAS_MODEL,
    SOLVED,
    UNLABELLED,
    VERSIONS,
    Message,
    decode_frame,
    decode_message,
    encode_frame,
    encode_message,
)
from asterism.live.protocols.natnet_messages import (
    ServerInfo,
    decode_marker_sets,
    decode_server_info,
    encode_connect,
    encode_marker_set,
    encode_server_info,
    wanted_version,
)
from asterism.live.protocols.packet_error import PacketError

PLACES = st.integers(0, 40).flatmap(
    lambda n: arrays(np.float64, (n, 3), elements=st.floats(-100, 100, width=32))
)
VERSION = st.sampled_from(VERSIONS)


def frame(version, markers, points, number=1, time=0.5, name="Body"):
    ids = np.arange(len(points)) + 50_000
    packet = encode_frame(
        version, number, time, marker_set=name, markers=markers, points=points, ids=ids,
        ticks=(1, 2, 3),
    )  # fmt: skip
    return decode_message(packet)


@given(VERSION, PLACES, PLACES, st.integers(0, 2**32 - 1), st.data())
def test_frames_are_decoded_as_they_were_encoded(version, places, points, number, data):
    missing = data.draw(arrays(np.bool_, len(places)))
    markers = np.where(missing[:, None], np.nan, places)
    kind, body = frame(version, markers, points, number, 1234.5, "Körper")
    assert kind == Message.FRAME
    found = decode_frame(body, version)
    assert (found.number, found.time) == (number, 1234.5)
    assert (found.exposed, found.received, found.sent) == (1, 2, 3)
    assert list(found.marker_sets) == (["Körper"] if len(markers) else [])
    if len(markers):
        np.testing.assert_array_equal(found.marker_sets["Körper"], markers)
    np.testing.assert_array_equal(found.others, points)
    seen = np.flatnonzero(~missing)
    np.testing.assert_array_equal(found.labelled["place"], np.vstack([markers[seen], points]))
    ids = [(1 << 16) + i + 1 for i in seen] + [50_000 + i for i in range(len(points))]
    assert found.labelled["id"].tolist() == ids
    flags = [SOLVED | HAS_MODEL] * len(seen) + [SOLVED | UNLABELLED] * len(points)
    assert found.labelled["flags"].tolist() == flags


@given(VERSION, st.integers(0, 10**6), st.integers(0, 10**6), st.integers(1, 255))
def test_truncated_and_altered_frames(version, cut, change, by):
    _, body = frame(version, np.ones((4, 3)), np.ones((5, 3)))
    with contextlib.suppress(PacketError):  # the last bytes are flags that are not read
        decode_frame(body[: cut % len(body)], version)
    with pytest.raises(PacketError):
        decode_frame(body[: cut % (len(body) - 40)], version)
    altered = bytearray(body)
    altered[change % len(body)] ^= by
    with contextlib.suppress(PacketError):
        decode_frame(altered, version)


@given(st.binary(max_size=300), VERSION)
def test_garbage_raises_only_the_error_of_packets(data, version):
    for read in (decode_message, decode_server_info, wanted_version):
        with contextlib.suppress(PacketError):
            read(data)
    for read in (decode_frame, decode_marker_sets):
        with contextlib.suppress(PacketError):
            read(data, version)


@given(VERSION, st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]),
                                 max_size=20), min_size=1, max_size=50))  # fmt: skip
def test_model_definitions(version, names):
    kind, body = decode_message(encode_marker_set("Body", tuple(names), version))
    assert kind == Message.MODEL
    assert decode_marker_sets(body, version) == {"Body": tuple(names)}
    assert decode_marker_sets(decode_message(encode_marker_set("", (), version))[1], version) == {}


@pytest.mark.parametrize("group", ["", "239.255.42.99"])
def test_server_info(group):
    info = ServerInfo("Asterism", (4, 1), 10_000_000, 1511, group)
    kind, body = decode_message(encode_server_info(info))
    assert kind == Message.SERVER_INFO
    assert decode_server_info(body) == info


def test_versions_that_clients_want():
    assert wanted_version(decode_message(encode_connect((4, 1)))[1]) == (4, 1)
    assert wanted_version(b"Ping\0") is None


def test_a_body_that_no_datagram_holds_is_refused():
    with pytest.raises(PacketError):
        encode_message(Message.FRAME, bytes(65_504))
