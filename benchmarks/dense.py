"""Speed on dense scenes, in which the nearest point of the next frame is often another marker's.

Scene: `simulate.dense` (8 markers per m³ in smooth random motion, 80 mm a frame in the mean), 200
frames, 10 % missing, 10 % clutter, noise 5 mm. The model is estimated from the capture, which is
timed as well, and selects one motion here. The rows with three motions have that one and two more,
with half and with ten times its acceleration, as estimates of real captures have. Frames per second
are those of the association by each method; the confidence of links and identities, which
`am.track` adds, has a column of its own, for GNN. Each figure is the best of three runs in
processor time, or one run if that takes longer than ten seconds.

    python benchmarks/dense.py [--sizes N …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.tracking.confidence.identity import assess
from asterism.tracking.methods.associate import associate
from report import conditions, publish

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
LEVELS = (0.5, 1, 10)
"""Accelerations of the three motions, relative to that of the one."""


def three_motions(model: am.TrackingModel) -> am.TrackingModel:
    """Return the model with three interacting motions around its own."""
    (own,) = model.motion.modes
    assert isinstance(own, am.DWNA)
    single = tuple(replace(own, acceleration_sigma=k * own.acceleration_sigma) for k in LEVELS)
    transitions = np.array([[0.95, 0.045, 0.005], [0.045, 0.95, 0.005], [0.25, 0.25, 0.5]])
    return replace(model, motion=am.InteractingMotions(models=single, transitions=transitions))


def rows_of(n_markers: int) -> list[list[str]]:
    """Estimate the model of one scene, and track it with each method, with one motion and three."""
    scene = am.simulate.dense(n_markers=n_markers, frames=200, seed=1)
    capture = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.005, seed=2)
    d = capture.detections
    estimation = min(_timed(partial(am.estimate_model, d))[0] for _ in range(3))
    model = am.estimate_model(d).model
    rows: list[list[str]] = []
    for own, taken in ((model, f"{estimation:.2f} s"), (three_motions(model), "–")):
        row, confidence = [str(n_markers), taken, str(len(own.motion.modes))], float("nan")
        for method in METHODS.values():
            work = partial(associate, method, d, own, seed=0)
            seconds, tracks = _timed(work)
            if seconds < LONG:
                seconds = min(seconds, *(_timed(work)[0] for _ in range(2)))
            idf1 = am.evaluate(tracks, capture).idf1
            rate = d.n_frames / seconds
            row.append(f"{rate:,.0f} ({idf1:.4f})" if rate >= 100 else f"{rate:.3g} ({idf1:.4f})")
            if method is METHODS["gnn"]:
                confidence = min(_timed(partial(assess, tracks, own))[0] for _ in range(3))
        row.append(f"{1e3 * confidence / d.n_frames:.2f} ms")
        rows.append(row)
    return rows


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time of some work, seconds, and its result."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[50, 200, 1000])
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = [
        "markers",
        "estimation",
        "motions",
        *(f"{name}: frames/s (IDF1)" for name in METHODS),
        "confidence, a frame",
    ]
    lines = ["| " + " | ".join(head) + " |", "|" + "---:|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for n in options.sizes for row in rows_of(n)]
    publish([*lines, "", f"{conditions()}; one core, processor time."], options.markdown)


if __name__ == "__main__":
    main()
