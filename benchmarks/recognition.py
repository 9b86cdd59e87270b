"""Names by distances: bonds learnt from the first half of a capture, used on the second.

The second half comes without names and in another order: as labelled, and after it was occluded in
bursts (up to 5 markers at a time for 5 to 60 frames, ghosts, 0.3 mm of noise), tracked and
stitched.

    python benchmarks/recognition.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from captures import captures, named_only
from report import conditions, publish, table


def part(tracks: am.Tracks, first: int, last: int) -> am.Tracks:
    """Give the frames from first to last - 1."""
    d = tracks.detections
    inside = (d.frame_of >= first) & (d.frame_of < last)
    cut = am.Detections(
        times=d.times[first:last],
        offsets=d.offsets[first : last + 1] - d.offsets[first],
        points=d.points[inside],
    )
    return am.Tracks(detections=cut, labels=tracks.labels[inside], names=tracks.names)


def shares(found: am.Tracks, truth: am.Tracks) -> tuple[float, float]:
    """Give the percent of the markers' detections with the right name, and with a wrong one."""
    own = np.array([*truth.names, None], dtype=object)[truth.labels]
    given = np.array([*found.names, None], dtype=object)[found.labels]
    is_marker = truth.labels >= 0
    is_named = np.array([name is not None for name in given])
    right = is_named & (given == own)
    return 100 * right[is_marker].mean(), 100 * (is_named & ~right)[is_marker].mean()


def row(path: Path, truth: am.Tracks) -> list[str]:
    n_frames = truth.detections.n_frames
    bonds = am.learn_bonds(part(truth, 0, n_frames // 2))
    second = part(truth, n_frames // 2, n_frames)
    was = np.random.default_rng(0).permutation(second.n_tracks)
    labels = np.where(second.labels >= 0, np.argsort(was)[second.labels], -1)
    start = time.perf_counter()
    found = am.name_tracks(am.Tracks(detections=second.detections, labels=labels), bonds)
    seconds = time.perf_counter() - start
    is_there = second.lengths[was] > 0
    n_right = int((found.markers == was)[is_there].sum())
    occluded = am.simulate.corrupt(second, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    named = am.name_tracks(am.track(occluded.detections, stitch=True), bonds).tracks
    right, wrong = shares(named, occluded)
    return [
        path.name,
        f"{len(bonds.pairs)}",
        f"{len(bonds.clusters)}",
        f"{n_right} of {int(is_there.sum())}",
        f"{right:.1f}",
        f"{wrong:.1f}",
        f"{seconds:.1f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for path in captures(options.data):
        if options.only not in path.name:
            continue
        capture = am.read(path)
        if any(capture.names):
            rows.append(row(path, named_only(capture.tracks)))
    head = ("capture", "bonds", "clusters", "markers right", "right %", "wrong %", "s")
    lines = [
        "The second half of each capture, named by what was learnt from the first: as labelled "
        "(markers right, and the time for it), and occluded in bursts, tracked by SMP over three "
        "frames and stitched (of all detections of markers, those with the right name and with a "
        "wrong one). Seeds 0 and 1.",
        "",
        *table(head, rows),
        "",
        f"{conditions()}.",
    ]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
