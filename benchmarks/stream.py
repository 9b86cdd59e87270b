"""Every method in a stream, and stitching: time of a frame, and whether time and memory stay flat.

A person of 53 markers at 100 Hz in bursts (up to 5 markers occluded at a time for 5 to 60 frames,
up to 3 ghosts, 0.3 mm of noise), frame by frame from Python. The stream goes forward and backward
through the recorded frames. Each method has a process of its own, which takes `--frames` frames, or
fewer where they last longer than `--seconds`, but at least `--min-frames`. Each frame is processed
by a method alone. Where stitching is measured, it is also processed by the same method, stitched;
the third row is that step without the time that the method takes inside it. Times are of the
processor in the thread, because others share the machine. For the same reason the stream is
repeated with the same frames `--repeats` times, and the time of a frame is the least of these.
Memory is that of the process after a third of `--min-frames`, when the method has seen all recorded
frames, and at the end of the last run.

With `--flat`, one stream of `--frames` frames is measured instead: GNN, stitched, of the cube's
markers in bursts, with the mean step and the memory of each tenth.

    python benchmarks/stream.py [--flat] [--frames N] [--min-frames N] [--seconds S] [--recorded N]
                                [--repeats N] [--methods NAME …] [--jobs N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from time import monotonic, thread_time
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


class Timed(am.tracking.Method[Any]):
    """A method that adds up the time of its steps."""

    name = "timed"

    def __init__(self, method: am.tracking.Method[Any]) -> None:
        self.method, self.spent = method, 0.0
        self.window = getattr(method, "window", 3)  # `Stitched` reads it

    def init(self, model: am.TrackingModel, **options: Any) -> Any:
        """Return the state of the method."""
        return self.method.init(model, **options)

    def step(self, state: Any, time: float, points: Any, **options: Any) -> Any:
        """Take a step of the method."""
        start = thread_time()
        result = self.method.step(state, time, points, **options)
        self.spent += thread_time() - start
        return result


def measured(
    method: am.tracking.Method[Any],
    model: am.TrackingModel,
    d: am.Detections,
    options: argparse.Namespace,
    *,
    stitch: bool,
) -> tuple[NDArray[np.float64], float, float]:
    """Measure a stream.

    Returns the milliseconds of each frame, shape (N, 3), by the method, by the same stitched, and
    by stitching alone (nan where it is not measured); megabytes early on, and at the end.
    """
    model = am.tracking.tracklet_model(model)
    timed = Timed(method)
    stitched = am.tracking.Stitched(method=timed)
    state, both = method.init(model), stitched.init(model)
    # The times themselves must not add to the memory, so that their pages are written here.
    taken = np.full((options.frames, 3), np.nan)
    end = monotonic() + options.seconds
    early, n = resident(), 0
    for t, (now, points) in enumerate(back_and_forth(d, options.frames)):
        if t >= options.min_frames and monotonic() > end:
            break
        start = thread_time()
        state, _ = method.step(state, now, points)
        taken[t, 0] = thread_time() - start
        if stitch:
            timed.spent, before, start = 0.0, both.tracklets, thread_time()
            both, _ = stitched.step(both, now, points)
            taken[t, 2] = thread_time() - start - timed.spent
            del before  # the state of the method, which stitching alone does not free
            taken[t, 1] = thread_time() - start
        n = t + 1
        if n == options.min_frames // 3:
            early = resident()
    return 1e3 * taken[:n], early, resident()


def flat_rows(n_frames: int, n_recorded: int) -> list[list[str]]:
    """Measure a long stitched stream of few markers: a row for each tenth of it."""
    cube = am.simulate.cube(frames=n_recorded, seed=1)
    capture = am.simulate.corrupt(cube, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    method = am.tracking.Stitched(method=METHODS["gnn"])
    state = method.init(am.estimate_model(capture.detections).model)
    rows: list[list[str]] = []
    tenth, spent = n_frames // 10, 0.0
    for t, (now, points) in enumerate(back_and_forth(capture.detections, 10 * tenth), start=1):
        start = thread_time()
        state, _ = method.step(state, now, points)
        spent += thread_time() - start
        if t % tenth == 0:
            rows.append([f"{t:,}", f"{1e3 * spent / tenth:.4f}", f"{resident():.1f}"])
            print(*rows[-1], flush=True)
            spent = 0.0
    return rows


def rows_of(options: argparse.Namespace, name: str) -> list[list[str]]:
    """Measure a method in a stream: a row of its own, and two of its stitching if that is asked."""
    person = am.simulate.person(seed=1, frames=min(options.recorded, options.frames))
    capture = am.simulate.corrupt(person, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=1)
    model = am.estimate_model(capture.detections).model
    stitch = name in STITCHED
    runs = [
        measured(METHODS[name], model, capture.detections, options, stitch=stitch)
        for _ in range(options.repeats)
    ]
    n = min(len(taken) for taken, *_ in runs)
    taken = np.min([taken[:n] for taken, *_ in runs], axis=0)
    memory = runs[0][1], runs[-1][2]
    rows = [row(name, taken[:, 0], [f"{x:.1f}" for x in memory])]
    if stitch:
        rows.append(row(f"{name}, stitched", taken[:, 1], ["", ""]))
        rows.append(row("stitching alone", taken[:, 2], ["", ""]))
    return rows


def row(name: str, taken: NDArray[np.float64], memory: list[str]) -> list[str]:
    tenth = max(len(taken) // 10, 1)
    ms = [float(np.percentile(taken, q)) for q in (50, 99, 99.9, 100)]
    figures = [taken.mean(), *ms, taken[:tenth].mean(), taken[-tenth:].mean()]
    return [name, f"{len(taken):,}", *(f"{x:.3f}" for x in figures), *memory]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000, help="of the stream, at most")
    parser.add_argument("--min-frames", type=int, default=30_000, help="of the stream, at least")
    parser.add_argument("--seconds", type=float, default=120.0, help="of a method's stream")
    parser.add_argument("--recorded", type=int, default=6000, help="frames through which it goes")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--repeats", type=int, default=3, help="runs over the same frames")
    parser.add_argument("--jobs", type=int, default=1, help="methods measured at a time")
    parser.add_argument("--flat", action="store_true", help="one long stream of few markers")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    if options.flat:
        lines = table(
            ["frames", "mean step since the row before, ms", "MB"],
            flat_rows(options.frames, options.recorded),
        )
        publish([*lines, "", f"Processor time. {conditions()}."], options.markdown)
        return
    options.min_frames = min(options.min_frames, options.frames)
    rows: list[list[str]] = []
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=spawn, max_tasks_per_child=1) as pool:
        for its_rows in pool.map(partial(rows_of, options), options.methods):
            print(*its_rows, sep="\n", flush=True)
            rows += its_rows
    head = ["ms a frame", "frames", "mean", "median", "99 %", "99.9 %", "most",
            "mean of the first tenth", "of the last", "MB early on", "MB at the end"]  # fmt: skip
    about = (
        f"Each stream has {options.frames:,} frames, or as many as {options.seconds:,.0f} s allow, "
        f"but at least {options.min_frames:,}. Memory is of the method's process, both stitched "
        f"and not, after {options.min_frames // 3:,} frames and at the end of all runs. Processor "
        f"time, for each frame the least of {options.repeats} runs. {conditions()}."
    )
    publish([*table(head, rows), "", about], options.markdown)


if __name__ == "__main__":
    main()
