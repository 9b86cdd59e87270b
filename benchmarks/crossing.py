"""The hard crossing: a cube that turns passes through another, 16 markers, nothing to tell them by.

Cubes of side 0.25; the moving one comes at 0.02 a frame and turns 0.08 rad a frame about z, half of
that about y, its centre off by N(0, 0.025) on each axis; 60 frames, σ = 0.02, P_d = 0.9, 1.6 false
alarms a frame, d̄ = 3. Methods side by side on one model that is nearly right.

    python benchmarks/crossing.py [--scenes N] [--markdown FILE] [--figure FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from methods import LinkConfidence, links
from report import conditions, publish, table

FRAMES, NOISE, ALARMS = 60, 0.02, 1.6
METHODS: dict[str, am.tracking.Method[Any]] = {
    "gnn": am.GNN(),
    "smp, window=3": am.SMP(window=3),
    "jpda": am.JPDA(),
    "tomht": am.TOMHT(window=5),
    "mht": am.MHT(window=5),
    "mcmcda, 300 moves a frame": am.MCMCDA(end_odds=1, moves=300 / 16),
    "mcmcda, 3000 moves a frame": am.MCMCDA(end_odds=1, moves=3000 / 16),
    "mcmcda, … 10 times the confidence": am.MCMCDA(end_odds=1, moves=3000 / 16, confidence=250),
}


def turned(about_z: float, about_y: float) -> Any:
    (cz, sz), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (about_z, about_y))
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return z @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])


def crossing(seed: int) -> tuple[am.Tracks, am.TrackingModel]:
    rng = np.random.default_rng(seed)
    cube = 0.125 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    off = rng.normal(0, 0.025, 3)
    places = np.array(
        [
            np.concatenate(
                [cube, cube @ turned(0.08 * t, 0.04 * t).T + off + [0.02 * (t - FRAMES / 2), 0, 0]]
            )
            for t in range(FRAMES)
        ]
    )
    low, high = places.min((0, 1)) - 0.3, places.max((0, 1)) + 0.3
    volume = float(np.prod(high - low))
    frames: list[Any] = []
    labels: list[Any] = []
    for at in places:
        seen = np.flatnonzero(rng.random(16) < 0.9)
        false = rng.uniform(low, high, (rng.poisson(ALARMS), 3))
        points = np.concatenate([at[seen] + rng.normal(0, NOISE, (len(seen), 3)), false])
        order = rng.permutation(len(points))
        frames.append(points[order])
        labels.append(np.concatenate([seen, np.full(len(false), -1)])[order])
    d = am.Detections.from_frames(np.arange(FRAMES, dtype=float), frames)
    model = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=0.002, velocity_sigma=0.05),
        sensor=am.Sensor(noise_sigma=NOISE, p_detection=0.9, clutter_density=ALARMS / volume),
        population=am.Population(
            birth_density=0.05 / volume, p_disappear=0.01, max_speed=0.15, max_gap=3
        ),
    )
    return am.Tracks(detections=d, labels=np.concatenate(labels).astype(np.int64)), model


def reliability(parts: dict[str, tuple[Any, Any]], path: Path) -> None:
    """Draw the share of right links by their confidence."""
    from matplotlib.figure import Figure

    from asterism.plot.style import CYCLE

    figure = Figure(figsize=(5.2, 4.2), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1, label="as sure as right")
    edges = np.linspace(0, 1, 11)
    for (name, (sure, right)), color in zip(parts.items(), CYCLE, strict=False):
        which = np.clip(np.digitize(sure, edges) - 1, 0, 9)
        rows = [(sure[which == b].mean(), right[which == b].mean(), (which == b).sum())
                for b in range(10) if (which == b).sum() >= 10]  # fmt: skip
        x, y, n = np.array(rows).T
        axes.errorbar(
            x, y, yerr=np.sqrt(y * (1 - y) / n), fmt="o-", markersize=4, color=color, label=name
        )
    axes.set(xlabel="confidence of a link", ylabel="share that is right", xlim=(0, 1), ylim=(0, 1))
    axes.legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=64)
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    scenes = [crossing(seed) for seed in range(options.scenes)]
    rows: list[list[str]] = []
    confidence = LinkConfidence()
    for name, method in METHODS.items():
        wrong: list[float] = []
        wrong_links: list[float] = []
        value: list[float] = []
        ms: list[float] = []
        for seed, (truth, model) in enumerate(scenes):
            start = time.perf_counter()
            tracks = am.track(truth.detections, method, model=model, seed=seed)
            ms.append(1e3 * (time.perf_counter() - start) / FRAMES)
            wrong.append(am.evaluate(tracks, truth).wrong_percent)
            wrong_links.append(100 * float((~links(tracks, truth)[2]).mean()))
            value.append(tracks.info["log_posterior"])
            confidence.add(name, tracks, truth)
        error = np.std(wrong) / np.sqrt(len(wrong))
        rows.append([name, f"{np.mean(wrong):.2f} ± {error:.2f}", f"{np.mean(wrong_links):.2f}",
                     f"{np.mean(value):.1f}", f"{np.mean(ms):.2f}"])  # fmt: skip
        print(*rows[-1], flush=True)
    if options.figure:
        shown = {"jpda": "jpda", "mht": "mht", "mcmcda": "mcmcda, 3000 moves a frame"}
        parts = {label: confidence.links(name) for label, name in shown.items()}
        reliability(parts, options.figure)
    head = ["method", "% wrong", "% wrong links", "log posterior", "ms a frame"]
    lines = [*table(head, rows), "", *confidence.table(), ""]
    lines.append(f"{options.scenes} scenes. {conditions()}.")
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
