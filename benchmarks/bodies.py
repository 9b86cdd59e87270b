"""Rigid prediction of occluded markers inside a tracker: gains, costs and losses.

Real captures (in ``../shared/data``) in bursts with ghosts and with 10 % missing and 10 % clutter
(`identity.py`): by each method alone, with bodies, stitched, and both; and scenes in which hardly
anybody keeps a distance, 10 % missing and 10 % clutter. Times are those of the process.

    python benchmarks/bodies.py [--data FOLDER] [--only NAME …] [--methods NAME …] [--seeds N]
                                [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from asterism.simulate import Burst, Ghosts
from asterism.tracking import Rigidity
from captures import captures
from report import conditions, publish, table

Found = dict[tuple[str, ...], list[tuple[float, ...]]]
Make = Callable[[Rigidity | None], am.tracking.Method[Any]]

CAPTURES = ("JA1Gait35", "tennis", "mocap36", "runway_13", "testdata")
SCENES = ("walk", "wander", "swarm", "attracted", "juggler")
METHODS: dict[str, Make] = {
    "gnn": lambda rigid: am.GNN(rigid=rigid),
    "smp": lambda rigid: am.SMP(rigid=rigid),
    "jpda": lambda rigid: am.JPDA(rigid=rigid),
    "smp3": lambda rigid: am.SMP(window=3, rigid=rigid),
    "splitting": lambda rigid: am.TrackSplitting(rigid=rigid),
    "tomht": lambda rigid: am.TOMHT(rigid=rigid),
    "mht": lambda rigid: am.MHT(rigid=rigid),
}
WAYS = ("off", "on", "stitched", "on, stitched")
HEAD = ("IDF1", "switches a 1000", "ghosts and clutter labelled, %", "ms a frame")


def bursts(truth: am.Tracks, seed: int) -> am.Tracks:
    return am.simulate.corrupt(truth, burst=Burst(), ghosts=Ghosts(), noise=3e-4, seed=seed)


def missing(truth: am.Tracks, seed: int) -> am.Tracks:
    return am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=seed)


CONDITIONS = {"bursts": bursts, "10 %/10 %": missing}


def figures(truth: am.Tracks, model: am.TrackingModel, make: Make, way: str) -> tuple[float, ...]:
    """Track in one way: IDF1, switches, ghosts, ms a frame."""
    d, method = truth.detections, make(Rigidity() if way.startswith("on") else None)
    start = time.process_time()
    if way.endswith("stitched"):
        tracks = am.track(d, method, model=model, seed=0, stitch=True)
    else:
        tracks = am.track(d, method, model=model, seed=0)
    ms = 1e3 * (time.process_time() - start) / d.n_frames
    e = am.evaluate(tracks, truth)
    return e.idf1, e.switches_per_1000, e.clutter_labelled_percent, ms


def row(found: list[tuple[float, ...]]) -> list[str]:
    means = np.mean(found, axis=0)
    return [f"{x:.{n}f}" for x, n in zip(means, (4, 2, 1, 2), strict=True)]


def idf1_of(found: Found, name: str, path: str) -> list[str]:
    """Give what a method came to in the bursts of a capture, each way."""
    return [row(found["bursts", name, way, path])[0] for way in WAYS]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", nargs="*", default=list(CAPTURES))
    parser.add_argument("--methods", nargs="*", default=list(METHODS))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    found: Found = {}
    oracles: dict[tuple[str, int], list[float]] = {}
    names: list[str] = []
    for path in captures(options.data):
        if not any(name in path.name for name in options.only):
            continue
        names.append(path.name)
        recorded = am.read(path).tracks
        for condition, corrupt in CONDITIONS.items():
            for seed in range(1, options.seeds + 1):
                truth = corrupt(recorded, seed)
                model = am.estimate_model(truth.detections).model
                for gap in (10, 60):
                    oracle = am.evaluate(am.metrics.oracle_tracks(truth, gap), truth).idf1
                    oracles.setdefault((condition, gap), []).append(oracle)
                for name in options.methods:
                    for way in WAYS:
                        one = figures(truth, model, METHODS[name], way)
                        found.setdefault((condition, name, way), []).append(one)
                        found.setdefault((condition, name, way, path.name), []).append(one)
                        done = (path.name, condition, str(seed), name, way, *row([one]))
                        print(*done, sep=" | ", flush=True)
    rows: list[list[str]] = []
    for condition in CONDITIONS:
        for gap in (10, 60):
            value = f"{np.mean(oracles[condition, gap]):.4f}"
            rows.append([f"{condition}, oracle at {gap} frames", value, "–", "–", "–"])
        for name in options.methods:
            rows += [
                [f"{condition}, {name}, {way}", *row(found[condition, name, way])] for way in WAYS
            ]
    lines = [f"Means over {len(names)} captures and {options.seeds} seeds:", ""]
    lines += [*table(("", *HEAD), rows), "", "IDF1 of each capture in bursts:", ""]
    each = [
        [f"{path}, {name}", *idf1_of(found, name, path)]
        for path in names
        for name in options.methods
    ]
    lines += [*table(("capture", *WAYS), each), "", "Where hardly anybody keeps a distance:", ""]
    lines += table(("scene", "off", "on"), [scene(name, options.methods[0]) for name in SCENES])
    lines += ["", f"{conditions()}."]
    publish(lines, options.markdown)


def scene(name: str, method: str) -> list[str]:
    """IDF1 of a scene, without bodies and with them."""
    values: list[list[float]] = [[], []]
    for seed in (1, 2):
        truth = am.simulate.corrupt(
            getattr(am.simulate, name)(seed=seed), missing=0.1, clutter=0.1, noise=1e-3, seed=seed
        )
        model = am.estimate_model(truth.detections).model
        for k, way in enumerate(WAYS[:2]):
            values[k].append(figures(truth, model, METHODS[method], way)[0])
    return [f"{name}, {method}", *(f"{np.mean(each):.4f}" for each in values)]


if __name__ == "__main__":
    main()
