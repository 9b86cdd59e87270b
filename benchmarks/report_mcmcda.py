"""The table of the 2010 report's §4.3: the turning cube, 10 % false alarms, 10 % missing, by N_mc.

100 frames of 8 markers, noise of 5 mm, v̄ = 0.15 a frame. The motion and the rates are read off each
clip. *floor* is the truth, broken at every gap that d̄ does not span. The report's own figures:
36, 12 and 0.1 % wrong, 12, 9 and 8 tracks, 10, 6 and 0.1 % missing labels, 41, 102 and 365 minutes,
at N_mc = 30, 80 and 1000 with d̄ = 2.

    python benchmarks/report_mcmcda.py [--seeds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from report import conditions, publish, table

MODEL: dict[str, Any] = {"end_odds": 1}
WHOLE: dict[str, Any] = {**MODEL, "groups": "whole", "confidence": 0}
REPORT: dict[str, Any] = {
    "proposal": "uniform", "move_weights": "report", "first_rules": True, "assignment": False,
    "at_doubts": 0, **WHOLE,
}  # fmt: skip
COUNTS = (30, 80, 1000)
WAYS: dict[str, tuple[dict[str, Any], tuple[int, ...]]] = {
    "the report's: uniform growth, its shares, ascent": ({**REPORT, "chain": "ascent"}, COUNTS),
    "… but true Metropolis": (REPORT, COUNTS),
    "… with two bonds": ({**REPORT, "bonds": 2}, (80,)),
    "… with three bonds": ({**REPORT, "bonds": 3}, (80,)),
    "… with four bonds": ({**REPORT, "bonds": 4}, (80,)),
    "… in cells of 0.5 m": ({**REPORT, "groups": "cells", "distance": 0.5}, (80,)),
    "… in clusters within 0.25 m": ({**REPORT, "groups": "clusters", "distance": 0.25}, (80,)),
    "informed growth, all moves": ({**WHOLE, "assignment": False}, COUNTS),
    "… from the exact assignment": (WHOLE, COUNTS),
    "… with four bonds, too": ({**WHOLE, "bonds": 4}, (30,)),
    "… in groups that plausible links join": ({**MODEL, "confidence": 0}, (30, 80)),
    "… and with confidence": (MODEL, (80,)),
}


def clips(seeds: int, max_gap: int) -> list[tuple[am.Tracks, am.TrackingModel]]:
    found: list[tuple[am.Tracks, am.TrackingModel]] = []
    for seed in range(seeds):
        scene = am.simulate.cube(frames=100, seed=seed)
        truth = am.simulate.sense(scene, missing=0.1, clutter=0.1, noise=0.005, seed=seed)
        model = am.estimate_model(truth.detections).model
        population = dataclasses.replace(model.population, max_speed=0.15, max_gap=max_gap)
        found.append((truth, dataclasses.replace(model, population=population)))
    return found


def row(e: list[am.Evaluation], more: list[float], moves: float, seconds: float) -> list[str]:
    wrong = [one.wrong_percent for one in e]
    return [
        f"{moves:.0f}" if moves else "–",
        f"{np.mean(wrong):.2f} ± {np.std(wrong):.2f}",
        f"{np.mean([one.n_tracks for one in e]):.1f}",
        f"{np.mean([one.missing_percent for one in e]):.2f}",
        f"{np.mean([one.idf1 for one in e]):.4f}",
        f"{np.mean(more):+.1f}",
        f"{1e3 * seconds:.0f}" if seconds else "–",
    ]


def rows_of(max_gap: int, seeds: int) -> list[list[str]]:
    some = clips(seeds, max_gap)
    floors = [am.floor(truth, max_gap) for truth, _ in some]
    best = [am.log_posterior(floor, model) for floor, (_, model) in zip(floors, some, strict=True)]
    found = [am.evaluate(floor, truth) for floor, (truth, _) in zip(floors, some, strict=True)]
    rows = [["floor", *row(found, [0.0], 0, 0)]]
    for name, (options, counts) in WAYS.items():
        for count in counts:
            method = am.MCMCDA(moves=count / 8.8, **options)  # detections in a frame, on average
            found, more, moves, seconds = [], [], [], []
            for seed, (truth, model) in enumerate(some):
                start = time.perf_counter()
                tracks = am.track(truth.detections, method, model=model, seed=seed)
                seconds.append(time.perf_counter() - start)
                found.append(am.evaluate(tracks, truth))
                more.append(tracks.info["log_posterior"] - best[seed])
                moves.append(tracks.info["moves"] / truth.detections.n_frames)
            title = f"{name}, N_mc = {count}"
            rows.append([title, *row(found, more, float(np.mean(moves)), float(np.mean(seconds)))])
            print(*rows[-1], flush=True)
    return rows


def speed(max_gap: int, seeds: int) -> list[list[str]]:
    """Microseconds a move, everything in Python counted: with one motion, on one core."""
    some: list[tuple[am.Tracks, am.TrackingModel]] = []
    for truth, model in clips(seeds, max_gap):
        motion = model.motion
        if isinstance(motion, am.InteractingMotions):
            motion = motion.models[0]
        some.append((truth, dataclasses.replace(model, motion=motion)))
    rows: list[list[str]] = []
    informed: dict[str, Any] = {**WHOLE, "at_doubts": 0}
    for name, options in {"uniform growth": REPORT, "informed growth": informed}.items():
        method = am.MCMCDA(moves=1000 / 8.8, **options)
        each: list[float] = []
        for truth, model in some:
            start = time.perf_counter()
            tracks = am.track(truth.detections, method, model=model, seed=1)
            each.append(1e6 * (time.perf_counter() - start) / tracks.info["moves"])
        rows.append([f"d̄ = {max_gap}, {name}", f"{np.median(each):.2f}", f"{min(each):.2f}"])
        print(*rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = ["", "moves a frame", "% wrong", "tracks", "% missing", "IDF1", "nats above the floor",
            "ms for all 100 frames"]  # fmt: skip
    lines: list[str] = []
    for max_gap in (2, 4):
        lines += [f"d̄ = {max_gap}:", "", *table(head, rows_of(max_gap, options.seeds)), ""]
    rows = [row for max_gap in (2, 4) for row in speed(max_gap, options.seeds)]
    lines += [*table(["µs a move, one motion", "median", "least"], rows), ""]
    lines += [f"Means over {options.seeds} seeds. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
