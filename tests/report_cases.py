"""Tracks for tests of the report, and a reader of the page that is independent of the player."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np

import asterism as am

HOSTILE = (
    "<script>alert(1)</script>",
    "</script><img src=x onerror=alert(2)>",
    "a & b &lt; \"c\" 'd'",
    "line\u2028separator",
    "\u202eright to left",
    "]]>--><!--",
)


def spoilt_person(frames=120, seed=1):
    """A walking person with misses and clutter: the truth, and tracks of it with confidence."""
    scene = am.simulate.person(frames=frames, seed=seed)
    truth = am.simulate.sense(scene, missing=0.06, clutter=0.06, noise=0.0005, seed=seed)
    return truth, am.track(truth.detections, am.JPDA())


def unpacked(page):
    """Read header and arrays of a page, from the description in packing.py alone."""
    text = re.search(rb'<script type="text/plain" id="data">([^<]*)</script>', page)[1]
    content = zlib.decompress(base64.b64decode(text, validate=True))
    n = int.from_bytes(content[:4], "little")
    header, at, arrays = json.loads(content[4 : 4 + n]), 4 + n, {}
    for name, (kind, count) in header["arrays"].items():
        size = np.dtype(kind).itemsize
        planes = np.frombuffer(content[at : at + size * count], np.uint8).reshape(size, count)
        arrays[name] = np.ascontiguousarray(planes.T).view(np.dtype(kind).newbyteorder("<"))[:, 0]
        at += size * count
    assert at == len(content)
    return header, arrays


def positions(header, arrays):
    """Positions of all points of a page, shape (N, 3), one by one."""
    begins = {int(i) for i in arrays["starts"]}
    found = np.empty((len(arrays["x"]), 3))
    for axis, name in enumerate("xyz"):
        low, step = header["grid"][0][axis], header["grid"][1][axis]
        before = pace = 0
        for i, zigzag in enumerate(arrays[name].tolist()):
            left = zigzag // 2 if zigzag % 2 == 0 else -(zigzag + 1) // 2
            if i in begins:
                before = pace = 0
            is_second = i - 1 in begins
            guess = before + (pace if header["order"] == 2 and not is_second else 0)
            cell = (guess + left) % 65536
            before, pace = cell, (0 if i in begins else cell - before)
            found[i, axis] = low + step * cell
    return found
