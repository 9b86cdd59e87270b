"""Distance bonds in the posterior of MCMCDA: what they win, what they cost, what they spoil.

The hard crossing (`crossing.py`) and smooth paths (`smooth.py`); scenes in which nobody keeps a
distance; and real captures (in ``../shared/data``) corrupted in bursts with ghosts (`identity.py`):
fragments that are stitched and, with ``--alone``, tracks by themselves.

    python benchmarks/bond_term.py [--weights W …] [--scenes N] [--seeds N] [--data FOLDER]
                                   [--only NAME …] [--alone] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from captures import captures
from crossing import crossing
from methods import LinkConfidence
from report import conditions, publish, table
from scenes import sensed
from smooth import smooth

if TYPE_CHECKING:
    from collections.abc import Callable

Problem = tuple[am.Tracks, am.TrackingModel]

CAPTURES = ("JA1Gait35", "tennis", "mocap36", "runway_13", "testdata")
HEAD = ("bond_weight", "IDF1", "switches a 1000", "ghosts and clutter labelled, %", "% wrong",
        "log posterior", "ms a frame")  # fmt: skip


def scene(case: str, seed: int) -> Problem:
    truth = sensed(case, seed, through_cameras=False)
    return truth, am.estimate_model(truth.detections).model


def bursts(capture: am.Capture, seed: int) -> am.Tracks:
    return am.simulate.corrupt(
        capture.tracks, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed
    )


class Figures:
    """Means of what is measured."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def add(self, found: am.Tracks, truth: am.Tracks, value: float, seconds: float) -> None:
        """Count one run."""
        e = am.evaluate(found, truth)
        self.rows.append(
            (e.idf1, e.switches_per_1000, e.clutter_labelled_percent, e.wrong_percent, value,
             1e3 * seconds / truth.detections.n_frames)
        )  # fmt: skip

    def text(self) -> list[str]:
        """Give the means, and the standard error of the first."""
        rows = np.array(self.rows)
        error = rows[:, 0].std() / np.sqrt(len(rows))
        means = rows.mean(axis=0)
        first = f"{means[0]:.4f} ± {error:.4f}"
        rest = [f"{x:.{n}f}" for x, n in zip(means[1:], (2, 2, 2, 1, 2), strict=True)]
        # A marker that is joined over a long gap is no track of the model.
        return [first, *("–" if x == "-inf" else x for x in rest)]


def simulated(
    name: str, make: Callable[[int], Problem], n: int, weights: list[float], end_odds: float
) -> tuple[list[list[str]], LinkConfidence]:
    """Track scenes with each weight."""
    problems = [make(seed) for seed in range(n)]
    rows: list[list[str]] = []
    confidence = LinkConfidence()
    for weight in weights:
        figures = Figures()
        for seed, (truth, model) in enumerate(problems):
            method = am.MCMCDA(end_odds=end_odds, bond_weight=weight)
            start = time.perf_counter()
            tracks = am.track(truth.detections, method, model=model, seed=seed)
            taken = time.perf_counter() - start
            figures.add(tracks, truth, tracks.info["log_posterior"], taken)
            confidence.add(f"{name}, {weight:g}", tracks, truth)
        rows.append([f"{name}, {weight:g}", *figures.text()])
        print(*rows[-1], sep=" | ", flush=True)
    return rows, confidence


def corrupted(
    path: Path, seeds: int, weights: list[float], *, alone: bool
) -> list[tuple[str, float, Figures]]:
    """Track and stitch a capture with each weight."""
    capture = am.read(path)
    out: list[tuple[str, float, Figures]] = []
    ways = ("alone", "stitched") if alone else ("stitched",)
    found = {(way, weight): Figures() for way in ways for weight in weights}
    for seed in range(1, seeds + 1):
        truth = bursts(capture, seed)
        d = truth.detections
        model = am.estimate_model(d).model
        for way, weight in found:
            method = am.MCMCDA(bond_weight=weight)
            start = time.perf_counter()
            if way == "alone":
                tracks = am.track(d, method, model=model, seed=0)
            else:
                tracks = am.track(d, method, model=model, seed=0, stitch=True)
            taken = time.perf_counter() - start
            found[way, weight].add(tracks, truth, am.log_posterior(tracks, model), taken)
    for (way, weight), figures in found.items():
        out.append((way, weight, figures))
        print(path.name, way, f"{weight:g}", *figures.text(), sep=" | ", flush=True)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--weights", type=float, nargs="*", default=[0.0, 2.0])
    parser.add_argument("--scenes", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", nargs="*", default=list(CAPTURES))
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    weights: list[float] = options.weights
    few = max(options.scenes // 8, 1) if options.scenes else 0
    scenes: list[list[str]] = []
    sure: list[str] = []
    for name, make, n, end_odds in (
        ("hard crossing", crossing, options.scenes, 1.0),
        ("smooth, 53 markers", partial(smooth, 53, 300), few, 1.0),
        ("wander", partial(scene, "wander"), few, 1000.0),
        ("attracted", partial(scene, "attracted"), few, 1000.0),
        ("swarm", partial(scene, "swarm"), few, 1000.0),
    ):
        if n == 0:
            continue
        rows, confidence = simulated(name, make, n, weights, end_odds)
        scenes += rows
        sure = confidence.table() if name == "hard crossing" else sure
    each: list[list[str]] = []
    means: dict[tuple[str, float], Figures] = {}
    for path in captures(options.data):
        if not any(name in path.name for name in options.only):
            continue
        for way, weight, figures in corrupted(path, options.seeds, weights, alone=options.alone):
            each.append([f"{path.name}, {way}, {weight:g}", *figures.text()])
            means.setdefault((way, weight), Figures()).rows += figures.rows
    lines = [f"Simulated scenes ({options.scenes} crossings, {few} of the others):", ""]
    if scenes:
        lines += [*table(HEAD, scenes), "", "Links of the hard crossing:", "", *sure, ""]
    lines += [f"Captures in bursts, means of {options.seeds} seeds:", ""]
    rows = [[f"all, {way}, {weight:g}", *f.text()] for (way, weight), f in means.items()]
    lines += table(HEAD, rows + each)
    lines += ["", f"{conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
