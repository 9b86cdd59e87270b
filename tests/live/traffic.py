"""Datagrams of a recorded session, and what the vendor's client printed for them."""

from __future__ import annotations

import re
import struct


def datagrams(data):
    """Yield the UDP payloads of a capture file (pcapng with Ethernet frames)."""
    at = 0
    while at < len(data):
        kind, size = struct.unpack_from("<II", data, at)
        if kind == 6:  # a packet
            (captured,) = struct.unpack_from("<I", data, at + 20)
            packet = data[at + 28 : at + 28 + captured][14:]
            head = (packet[0] & 15) * 4
            (length,) = struct.unpack_from(">H", packet, head + 4)
            yield packet[head + 8 : head + length]
        at += size


def printed_frames(text):
    """Return what OptiTrack's sample client printed, by frame number.

    The client prints from two threads, so other lines may stand between those of a frame.
    """
    frames = {}
    for block in text.split("FrameID : ")[1:]:
        number = int(block.split("\n", 1)[0])
        frames[number] = {
            "time": re.search(r"Timestamp : ([\d.]+)", block)[1],
            "n_others": int(re.search(r"Other Markers \[Count=(\d+)\]", block)[1]),
            "others": re.findall(r"Other Marker \d+ : (\S+)\t(\S+)\t(\S+)", block),
            "bodies": re.findall(r"Rigid Body \[ID=(\d+)  Error=(\S+)  Valid=(\d)\]", block),
            "poses": re.findall(r"qw\s+" + r"\s+".join([r"(-?[\d.]+)"] * 7), block),
            "n_skeletons": int(re.search(r"Skeletons \[Count=(\d+)\]", block)[1]),
            "labelled": re.findall(
                r"Labeled Marker \[ModelID=(\d+), MarkerID=(\d+), Occluded=(\d), PCSolved=(\d), "
                r"ModelSolved=(\d)\] \[size=(\S+)\] \[pos=(\S+),(\S+),(\S+)\]",
                block,
            ),
            "n_plates": int(re.search(r"Force Plate \[Count=(\d+)\]", block)[1]),
            "n_devices": int(re.search(r"Device \[Count=(\d+)\]", block)[1]),
        }
    return frames
