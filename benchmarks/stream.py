"""A stream: what a frame takes, how long an answer waits, and whether memory grows.

A person of 53 markers at 100 Hz in bursts (up to 5 markers occluded at a time for 5 to 60 frames,
up to 3 ghosts, 0.3 mm of noise), frame by frame from Python: each method alone, and two of them
stitched, in processor time. Memory is that of the process after a third of the stream and after all
of it.

    python benchmarks/stream.py [--frames N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from methods import METHODS as PLAIN
from report import conditions, publish, table

METHODS: dict[str, am.tracking.Method[Any]] = {
    **PLAIN,
    "gnn, stitched": am.tracking.Stitched(method=am.GNN()),
    "smp, window=3, stitched": am.tracking.Stitched(method=am.SMP(window=3)),
}


def resident() -> float:
    """Memory of this process, MB; nan where the system does not say."""
    status = Path("/proc/self/status")
    if not status.exists():
        return float("nan")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=6000)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    person = am.simulate.person(seed=1, frames=options.frames)
    capture = am.simulate.corrupt(person, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    model = am.estimate_model(capture.detections).model
    frames = list(capture.detections)
    rows: list[list[str]] = []
    for name, method in METHODS.items():
        state = method.init(am.tracking.tracklet_model(model))
        taken: list[float] = []
        held = [0.0]
        for t, (now, points) in enumerate(frames):
            start = time.thread_time()
            state, _ = method.step(state, now, points)
            taken.append(1e3 * (time.thread_time() - start))
            if t in (len(frames) // 3, len(frames) - 1):
                held.append(resident())
        ms = [f"{np.percentile(taken, q):.3f}" for q in (50, 99, 99.9, 100)]
        rows.append([name, f"{np.mean(taken):.3f}", *ms, f"{held[-1] - held[-2]:+.1f}"])
        print(*rows[-1], flush=True)
    head = ["ms a frame", "mean", "median", "99 %", "99.9 %", "most", "MB more at the end"]
    lines = [*table(head, rows), "", f"{options.frames} frames, processor time. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
