"""A batch of real captures: serial, killed and resumed, and with two workers; all equal bytes.

The labelled captures of ``../shared/data`` (or ``--data``) are cut into pieces and corrupted with
different seeds, until there are as many as wanted. One damaged file is among them. The killed batch
is ended by SIGKILL at random moments and resumed. Prints Markdown.

    python benchmarks/batch.py [--captures N] [--frames N] [--kills N] [--data FOLDER]
        [--markdown FILE]
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import asterism as am
from captures import captures
from field_clips import cut
from report import publish, table

LINE = [sys.executable, "-m", "asterism.cli", "batch", "-q"]
MADE_EACH_RUN = ("index.html", "summary.csv")


def make(folder: Path, data: Path, n: int, frames: int) -> int:
    """Write ``n`` unlabelled captures and a damaged one; return the number of all frames."""
    found = [am.read(path) for path in captures(data)]
    labelled = [capture.tracks for capture in found if any(capture.names)]
    pieces = [cut(truth, frames, is_middle=half) for half in (False, True) for truth in labelled]
    total = 0
    for k in range(n):
        truth = am.simulate.corrupt(
            pieces[k % len(pieces)], missing=0.1, clutter=0.1, noise=3e-4, seed=k
        )
        clutter = np.full(truth.detections.n_points, -1)
        place = folder / f"subject{k % 10}" / f"trial{k:04d}.c3d"
        place.parent.mkdir(parents=True, exist_ok=True)
        am.write(am.Tracks(detections=truth.detections, labels=clutter), place)
        total += truth.detections.n_frames
    (folder / "subject0" / "damaged.c3d").write_bytes(b"\x02\x50" + b"junk" * 200)
    return total


def timed(source: Path, out: Path, workers: int) -> float:
    """Track all captures, and return the seconds."""
    start = time.perf_counter()
    done = subprocess.run([*LINE, str(source), "-o", str(out), "--workers", str(workers)])
    assert done.returncode == 1, "the damaged file, and it alone, fails"
    return time.perf_counter() - start


def killed(source: Path, out: Path, kills: int, seconds: float) -> int:
    """Kill a batch at random moments, and resume it; return how often it was running."""
    rng = np.random.default_rng(0)
    hit = 0
    for wait in rng.uniform(0.05, 2 / (kills + 1), kills) * seconds:
        process = subprocess.Popen(
            [*LINE, str(source), "-o", str(out), "--workers", "1"], stderr=subprocess.DEVNULL
        )
        time.sleep(max(float(wait), 2.0))
        process.send_signal(signal.SIGKILL)
        hit += process.wait() == -signal.SIGKILL
    timed(source, out, 1)
    return hit


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files that a batch writes once."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name not in MADE_EACH_RUN
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, default=300)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--kills", type=int, default=10)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frames = make(folder / "in", options.data, options.captures, options.frames)
        one = timed(folder / "in", folder / "one", 1)
        expected = contents(folder / "one")
        two = timed(folder / "in", folder / "two", 2)
        hit = killed(folder / "in", folder / "killed", options.kills, one)
        same = {
            "two workers": contents(folder / "two") == expected,
            "killed": contents(folder / "killed") == expected,
        }
    n = options.captures
    rows = [
        ["one worker", f"{one:.0f}", f"{one / n:.2f}", "1.00", "–"],
        ["two workers", f"{two:.0f}", f"{two / n:.2f}", f"{one / two:.2f}",
         "yes" if same["two workers"] else "NO"],
        [f"killed {hit} times while it ran", "–", "–", "–", "yes" if same["killed"] else "NO"],
    ]  # fmt: skip
    header = ["batch", "s", "s a capture", "speed", "bytes of the first"]
    lead = f"{n} captures, {frames:,} frames, and one damaged file; {os.cpu_count()} cores."
    publish([lead, "", *table(header, rows)], options.markdown)


if __name__ == "__main__":
    main()
