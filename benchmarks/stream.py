"""Every method in a stream, and stitching: time of a frame, and whether time and memory stay flat.

A person of 53 markers at 100 Hz in bursts (up to 5 markers occluded at a time for 5 to 60 frames,
up to 3 ghosts, 0.3 mm of noise), frame by frame from Python. The stream goes forward and backward
through the recorded frames. Each frame is processed by a method alone. Where stitching is measured,
it is also processed by the same method, stitched; the third row is the difference, frame by frame.
Times are of the processor in the thread, because others share the machine. Memory is that of the
process after a third of the stream and after all of it.

    python benchmarks/stream.py [--frames N] [--recorded N] [--methods NAME …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from methods import METHODS
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

STITCHED = ("gnn", "smp, window=3")
"""Methods that are measured stitched as well."""


def resident() -> float:
    """Memory of this process, MB; nan where the system does not say."""
    status = Path("/proc/self/status")
    if not status.exists():
        return float("nan")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def back_and_forth(d: am.Detections, n_frames: int) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Yield times and points of a stream of any length."""
    for t in range(n_frames):
        turn, at = divmod(t, d.n_frames)
        yield t * d.step, d.frame(at if turn % 2 == 0 else d.n_frames - 1 - at)


def measured(
    both: list[am.tracking.Method[Any]], model: am.TrackingModel, d: am.Detections, n_frames: int
) -> tuple[NDArray[np.float64], float]:
    """Milliseconds of each frame for each method, (N, n); megabytes more at the end."""
    states = [each.init(am.tracking.tracklet_model(model)) for each in both]
    taken = np.zeros((n_frames, len(both)))
    third = 0.0
    for t, (now, points) in enumerate(back_and_forth(d, n_frames)):
        for k, each in enumerate(both):
            start = time.thread_time()
            states[k], _ = each.step(states[k], now, points)
            taken[t, k] = 1e3 * (time.thread_time() - start)
        if t == n_frames // 3:
            third = resident()
    return taken, resident() - third


def row(name: str, taken: NDArray[np.float64], more: str) -> list[str]:
    tenth = max(len(taken) // 10, 1)
    ms = [float(np.percentile(taken, q)) for q in (50, 99, 99.9, 100)]
    figures = [taken.mean(), *ms, taken[:tenth].mean(), taken[-tenth:].mean()]
    return [name, *(f"{x:.3f}" for x in figures), more]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=6000, help="of the stream")
    parser.add_argument("--recorded", type=int, default=6000, help="frames through which it goes")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    person = am.simulate.person(seed=1, frames=min(options.recorded, options.frames))
    capture = am.simulate.corrupt(person, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    model = am.estimate_model(capture.detections).model
    rows: list[list[str]] = []
    for name in options.methods:
        both: list[am.tracking.Method[Any]] = [METHODS[name]]
        both += [am.tracking.Stitched(method=METHODS[name])] if name in STITCHED else []
        taken, more = measured(both, model, capture.detections, options.frames)
        rows.append(row(name, taken[:, 0], f"{more:+.1f}"))
        if name in STITCHED:
            rows.append(row(f"{name}, stitched", taken[:, 1], ""))
            rows.append(row("stitching alone", taken[:, 1] - taken[:, 0], ""))
        print(*rows[-1], flush=True)
    head = ["ms a frame", "mean", "median", "99 %", "99.9 %", "most", "mean of the first tenth",
            "of the last", "MB more at the end"]  # fmt: skip
    lines = [*table(head, rows), "", f"{options.frames} frames, processor time. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
