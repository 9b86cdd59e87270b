"""Tracks for tests of the report, and a reader of the page that is independent of the player."""

from __future__ import annotations

import base64
import dataclasses
import html
import json
import re
import zlib

import numpy as np

import asterism as am

K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
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
    truth = am.simulate.corrupt(scene, missing=0.06, clutter=0.06, noise=0.0005, seed=seed)
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


def full_page(path):
    """Write a page with all there can be: truth, cameras with lenses, confidence, hostile names."""
    truth, tracks = spoilt_person()
    names = [*HOSTILE, *(f"M{k}" for k in range(tracks.n_tracks - len(HOSTILE)))]
    tracks = dataclasses.replace(tracks, names=tuple(names))
    order, starts = tracks.by_track
    uncertain = order[starts[0] + 20 : starts[0] + 30]  # that the first is a place to check
    identity = np.ones(len(tracks.labels))
    identity[uncertain] = 0.35
    frames = tracks.detections.frame_of[uncertain]
    decision = am.model.Decision(
        kind="identity",
        track=0,
        first=int(frames[0]),
        last=int(frames[-1]),
        n_detections=10,
        probability=0.35,
        alternatives=(
            am.model.Alternative(track=1, probability=0.55),
            am.model.Alternative(track=None, probability=0.1),
        ),
    )
    labels = tracks.labels.copy()
    labels[order[starts[7] + 40 : starts[7] + 49]] = -1  # that there is a long gap
    tracks = dataclasses.replace(
        tracks, identity_confidence=identity, labels=labels, decisions=(decision,)
    )
    ring = am.Rig.ring(8, radius=4, height=2.5).cameras
    lens = am.camera.BrownConrady(k1=-0.2)
    ring = tuple(dataclasses.replace(c, K=K, lens=lens) for c in ring)
    # One amid the points: some are behind it, some too near, some too far.
    amid = am.Camera.look_at((0, 0, 1), (2, 0.1, 1), K=K, size_px=(1280, 1024), name="amid")
    points = tracks.detections.points
    pose = amid.T_camera_world
    seen = points[amid.project(points).visible] @ pose[2, :3] + pose[2, 3]
    near, far = (float(depth) for depth in np.quantile(seen, [0.2, 0.8]))
    amid = dataclasses.replace(amid, near=near, far=far)
    rig = am.Rig((*ring, amid))
    am.report(tracks, path, truth=truth, rig=rig, title=HOSTILE[0])
    return path, tracks, truth, rig


def text_of(page):
    """Return the text of a page without its markup."""
    return html.unescape(re.sub(rb"<[^>]*>", b" ", page).decode())
