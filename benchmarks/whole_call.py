"""The whole call `am.track(detections)` on real captures, and the estimate of the model in it.

Captures with names, corrupted as in `captures.py` (10 % missing, 10 % clutter, 0.3 mm of noise).
Times are of the processor, best of three calls. The first line is a small scene, the second a dense
one.

    python benchmarks/whole_call.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from captures import captures, corrupted, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def best_of_three(work: Callable[[], Any]) -> tuple[float, Any]:
    """Least processor time of three calls, seconds, and the result of the last."""
    times: list[float] = []
    result = None
    for _ in range(3):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
    return min(times), result


def scenes() -> Iterator[tuple[str, am.Tracks]]:
    cube = am.simulate.cube(frames=100, seed=1)
    yield "cube, 8 markers", am.simulate.corrupt(cube, missing=0.1, clutter=0.1, seed=2)
    dense = am.simulate.dense(n_markers=50, frames=200, seed=1)
    noisy = am.simulate.corrupt(dense, missing=0.1, clutter=0.1, noise=0.005, seed=2)
    yield "dense, 50 markers", noisy


def main() -> None:
    options = options_of_the_run(__doc__)
    inputs = list(scenes())
    for path in captures(options.data):
        capture = am.read(path)
        if any(capture.names):
            inputs.append((path.name, corrupted(capture.tracks)))
    rows: list[list[str]] = []
    figures: list[tuple[float, float, float]] = []
    for k, (name, truth) in enumerate(inputs):
        if options.only not in name:
            continue
        d = truth.detections
        estimate, _ = best_of_three(lambda d=d: am.estimate_model(d))
        whole, tracks = best_of_three(lambda d=d: am.track(d))
        idf1 = am.evaluate(tracks, truth).idf1
        rate = d.n_frames / whole
        rows.append([name, f"{d.n_frames}", f"{d.n_points / d.n_frames:.0f}",
                     f"{1e3 * estimate:.0f}", f"{1e3 * whole:.0f}", f"{rate:,.0f}", f"{idf1:.4f}",
                     tracks.recipe.chosen.partition(":")[0]])  # fmt: skip
        print(*rows[-1], flush=True)
        if k > 1:
            figures.append((estimate, rate, idf1))
    if figures:
        estimate, rate, idf1 = np.mean(figures, axis=0)
        rows.append(["**mean of the captures**", "", "", f"**{1e3 * estimate:.0f}**", "",
                     f"**{rate:,.0f}**", f"**{idf1:.4f}**", ""])  # fmt: skip
    head = ["capture", "frames", "points a frame", "estimate ms", "whole call ms", "frames/s",
            "IDF1", "method"]  # fmt: skip
    publish([*table(head, rows), "", f"{conditions()}; one process."], options.markdown)


if __name__ == "__main__":
    main()
