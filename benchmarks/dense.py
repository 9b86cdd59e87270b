"""Speed on dense scenes, in which the nearest point of the next frame is often another marker's.

Scene: `simulate.dense` (8 markers per m³ in smooth random motion, 80 mm a frame in the mean), 200
frames, 10 % missing, 10 % clutter, noise 5 mm. The model is estimated from the capture, which is
timed as well, and has its motions. Each figure is the best of three runs, or one run if that takes
longer than ten seconds.

    python benchmarks/dense.py [--sizes N …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import asterism as am
from report import best_of, conditions, publish

if TYPE_CHECKING:
    from collections.abc import Callable

METHODS = {
    "gnn": am.GNN(),
    "smp": am.SMP(),
    "jpda": am.JPDA(),
    "tomht": am.TOMHT(),
    "mcmcda": am.MCMCDA(),
}
LONG = 10.0  # seconds


def row_of(n_markers: int) -> list[str]:
    """Estimate the model of one scene and track it with each method."""
    scene = am.simulate.dense(n_markers=n_markers, frames=200, seed=1)
    capture = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.005, seed=2)
    d = capture.detections
    estimation = best_of(3, lambda: am.estimate_model(d))
    model = am.estimate_model(d).model
    row = [str(n_markers), f"{estimation:.2f} s", str(len(model.motion.modes))]
    for method in METHODS.values():
        work = partial(am.track, d, method, model=model, seed=0)
        seconds, tracks = _timed(work)
        if seconds < LONG:
            seconds = min(seconds, best_of(2, work))
        idf1 = am.evaluate(tracks, capture).idf1
        rate = d.n_frames / seconds
        row.append(f"{rate:,.0f} ({idf1:.4f})" if rate >= 100 else f"{rate:.3g} ({idf1:.4f})")
    return row


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the time of some work, seconds, and its result."""
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[50, 200, 1000])
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = ["markers", "estimation", "motions", *(f"{name}: frames/s (IDF1)" for name in METHODS)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---:|" * len(head)]
    lines += ["| " + " | ".join(row_of(n)) + " |" for n in options.sizes]
    publish([*lines, "", f"{conditions()}; one process."], options.markdown)


if __name__ == "__main__":
    main()
