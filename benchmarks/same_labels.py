"""Fingerprints of the labels of every method, to see whether a change of the code changes any.

Ten pieces of real captures (``../shared/data``, or ``--data``), as captured and corrupted, some at
half rate, and ten scenes; each tracked with its estimated model by every method, alone and
stitched. Run it before and after a change:

    python benchmarks/same_labels.py before.json
    python benchmarks/same_labels.py after.json --against before.json

Prints the lines that differ, with both log posteriors; exit code 1 where any does.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import asterism as am
from methods import METHODS

if TYPE_CHECKING:
    from collections.abc import Iterator

CAPTURES = (
    ("kinematics_racing_full", 2),
    ("kinematics_tennis_serve_2players", 1),
    ("kinematics_basket_sprint", 2),
    ("HC030A22", 1),
    ("PronetoRun01", 1),
    ("walking_1", 1),
    ("mocap36", 1),
    ("recording.tsv", 1),
    ("runway", 1),
    ("S09_KneeltoRun02", 1),
)
"""Part of the file's name, and the stride of frames."""

SCENES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("cube", {}),
    ("crossing", {}),
    ("wander", {}),
    ("attracted", {}),
    ("smooth", {"n_markers": 30, "frames": 100}),
    ("swarm", {}),
    ("person", {"activity": "run"}),
    ("two_people", {"activity": "hug"}),
    ("fingers", {}),
    ("juggler", {}),
)
FRAMES = 150
CASES = {**METHODS, "mda": am.MDA(), "mcmcda, confidence": am.MCMCDA(confidence=100)}


def piece(path: Path, stride: int) -> am.Tracks:
    """Middle frames of a capture; unnamed channels count as markers where none has a name."""
    capture = am.read(path)
    truth: am.Tracks = capture.tracks
    if any(capture.names):
        truth = am.simulate.corrupt(truth, stride=stride)
    d = truth.detections
    first = max((d.n_frames - FRAMES) // 2, 0)
    end = min(first + FRAMES, d.n_frames)
    inside = slice(int(d.offsets[first]), int(d.offsets[end]))
    return am.Tracks(detections=d.part(first, end), labels=truth.labels[inside])


def inputs(data: Path) -> Iterator[tuple[str, am.Detections]]:
    """Every input by its name, as it is and corrupted."""
    truths: dict[str, am.Tracks] = {}
    for name, stride in CAPTURES:
        found = sorted(p for p in data.rglob("*") if p.is_file() and name in p.name)
        if found:
            truths[name] = piece(found[0], stride)
    for name, options in SCENES:
        truths[name] = am.simulate.SCENES[name].make(seed=1, **options)
    for name, truth in truths.items():
        corrupted = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=1)
        yield name, truth.detections
        yield f"{name}, corrupted", corrupted.detections


def lines(data: Path) -> Iterator[tuple[str, list[Any]]]:
    """Name of a run; hash of its labels and confidences; log posterior and number of tracks."""
    for name, detections in inputs(data):
        model = am.estimate_model(detections).model
        yield f"{name}: model", [hashlib.sha256(repr(model).encode()).hexdigest(), 0.0, 0]
        for method_name, method in CASES.items():
            tracks = am.track(detections, method, model=model, seed=1)
            yield f"{name}: {method_name}", fingerprint(tracks)
            if method_name in ("smp, window=3", "mcmcda"):
                stitched = am.track(detections, method, model=model, seed=1, stitch=True)
                yield f"{name}: {method_name}, stitched", fingerprint(stitched)


def fingerprint(tracks: am.Tracks) -> list[Any]:
    digest = hashlib.sha256(tracks.labels.tobytes())
    if tracks.confidence is not None:
        digest.update(tracks.confidence.tobytes())
    return [digest.hexdigest(), float(tracks.info.get("log_posterior", 0.0)), tracks.n_tracks]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("out", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--data", type=Path, default=beside)
    options = parser.parse_args()
    before = json.loads(options.against.read_text()) if options.against else {}
    now: dict[str, list[Any]] = {}
    n_different = 0
    for name, value in lines(options.data):
        now[name] = value
        if name in before and before[name][0] != value[0]:
            n_different += 1
            was = f"log posterior {before[name][1]:.3f}, {before[name][2]} tracks"
            print(f"{name}: {was} -> {value[1]:.3f}, {value[2]}", flush=True)
    options.out.write_text(json.dumps(now, indent=1))
    compared = len(now.keys() & before.keys())
    print(f"{len(now)} results, {compared} compared, {n_different} differ")
    return 1 if n_different else 0


if __name__ == "__main__":
    sys.exit(main())
