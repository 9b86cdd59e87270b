"""C3D files byte by byte, made without the library, so that its reader has an honest opponent."""

from __future__ import annotations

import struct

import numpy as np

INTEL, DEC, SGI = 84, 85, 86


def _vax(values):
    """VAX F reals: the exponent's bias is 2 more, the 16-bit words stand the other way round."""
    words = (np.asarray(values, dtype="<f4") * np.float32(4)).view("<u2").reshape(-1, 2)
    return words[:, ::-1].tobytes()


def reals(values, processor=INTEL):
    if processor == DEC:
        return _vax(values)
    return np.asarray(values, dtype=">f4" if processor == SGI else "<f4").tobytes()


def integers(values, processor=INTEL):
    order = ">" if processor == SGI else "<"
    return (np.asarray(values, dtype=np.int64) & 0xFFFF).astype(f"{order}u2").tobytes()


def text(strings, width=None):
    width = width or max(map(len, strings), default=1)
    return (-1, (width, len(strings)), b"".join(s.encode().ljust(width) for s in strings))


def make_c3d(
    points,  # (T, K, 4) x, y, z, fourth word; raw integers if scale > 0
    *,
    labels=(),
    units="mm",
    rate=100.0,
    scale=-1.0,
    first=1,
    analog=None,  # (T, samples * channels) raw
    n_samples=0,
    processor=INTEL,
    more=(),  # further ("GROUP", "NAME", kind, dims, bytes)
    header_last=None,
    frames=None,
    drop=(),
):
    points = np.asarray(points, dtype=np.float64)
    n_frames, n_points = points.shape[:2]
    analog = np.zeros((n_frames, 0)) if analog is None else np.asarray(analog)
    frames = n_frames if frames is None else frames
    entries = [
        ("POINT", "USED", 2, (), integers([n_points], processor)),
        ("POINT", "SCALE", 4, (), reals([scale], processor)),
        ("POINT", "RATE", 4, (), reals([rate], processor)),
        ("POINT", "DATA_START", 2, (), integers([0], processor)),
        ("POINT", "FRAMES", 2, (), integers([frames], processor)),
    ]
    if units is not None:
        entries.append(("POINT", "UNITS", -1, (len(units),), units.encode()))
    for i in range(0, len(labels), 255):
        name = "LABELS" if i == 0 else f"LABELS{i // 255 + 1}"
        entries.append(("POINT", name, *text(list(labels[i : i + 255]))))
    entries = [e for e in entries if e[1] not in drop]
    entries += list(more)
    order = ">" if processor == SGI else "<"
    names = list(dict.fromkeys(e[0] for e in entries))
    section = b""
    for number, name in enumerate(names, start=1):
        section += struct.pack("bb", len(name), -number) + name.encode()
        section += struct.pack(order + "H", 3) + b"\0"
        for _, key, kind, dims, data in (e for e in entries if e[0] == name):
            body = struct.pack("bB", kind, len(dims)) + bytes(dims) + data + b"\0"
            section += struct.pack("bb", len(key), number) + key.encode()
            section += struct.pack(order + "H", len(body) + 2) + body
    section += b"\0\0"
    n_blocks = -(-(len(section) + 4) // 512)
    section = (bytes([1, 0x50, n_blocks, processor]) + section).ljust(n_blocks * 512, b"\0")
    last = first + n_frames - 1 if header_last is None else header_last
    header = bytearray(512)
    header[0:2] = b"\x02\x50"
    header[2:12] = integers([n_points, analog.shape[1], first, last, 10], processor)
    header[12:16] = reals([scale], processor)
    header[16:20] = integers([2 + n_blocks, n_samples], processor)
    header[20:24] = reals([rate], processor)
    values = np.hstack([points.reshape(n_frames, 4 * n_points), analog])
    data = (reals if scale < 0 else integers)(values, processor)
    body = bytes(header) + section + data
    return body.ljust(-(-len(body) // 512) * 512, b"\0")
