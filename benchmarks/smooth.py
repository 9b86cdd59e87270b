"""MCMC data association in real time: frames a second and latency on smooth paths.

n markers on Lissajous-like paths (amplitude 0.1 to 0.3, 0.08 to 0.18 rad a frame) about places 0.34
apart, drifting together; noise of 5 mm, 10 % missing, 10 % false alarms. Everything in one process
from Python: neighbours, bookkeeping of identities, and the oracle beside what was found.

    python benchmarks/smooth.py [--seeds N] [--markdown FILE]
    python benchmarks/smooth.py --lengths 500 1000 2000 4000 8000 [--markdown FILE]

The second is of whole captures of 50 markers (`window=None`): time and memory by their length.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from report import conditions, publish, table

SIZES = ((53, 100), (53, 1000), (200, 300), (1000, 100))
METHODS: dict[str, am.tracking.Method[Any]] = {
    "mcmcda, without confidence": am.MCMCDA(end_odds=1, confidence=0),
    "mcmcda": am.MCMCDA(end_odds=1),
    "mcmcda, 2 threads": am.MCMCDA(end_odds=1, threads=2),
    "mcmcda, groups=whole": am.MCMCDA(
        end_odds=1, chain=am.tracking.ChainOptions(groups="whole"), confidence=0
    ),
    "gnn": am.GNN(),
    "jpda": am.JPDA(),
    "mht": am.MHT(),
}


def smooth(n: int, frames: int, seed: int) -> tuple[am.Tracks, am.TrackingModel]:
    rng = np.random.default_rng(seed)
    side = int(np.ceil(n ** (1 / 3)))
    grid = np.array(np.meshgrid(*[np.arange(side)] * 3)).reshape(3, -1).T[:n] * 0.34
    amplitude, rate = rng.uniform(0.1, 0.3, (n, 3)), rng.uniform(0.08, 0.18, (n, 3))
    phase = rng.uniform(0, 2 * np.pi, (n, 3))
    t = np.arange(frames)[:, None, None]
    places = grid + amplitude * np.sin(rate * t + phase) + np.array([0.01, 0.005, 0]) * t
    low, high = places.min((0, 1)) - 0.3, places.max((0, 1)) + 0.3
    size = high - low
    found: list[Any] = []
    labels: list[Any] = []
    for at in places:
        seen = np.flatnonzero(rng.random(n) < 0.9)
        around = (at.min(0) - 0.3, at.max(0) + 0.3)
        false = rng.uniform(*around, (rng.poisson(0.1 * n), 3))
        points = np.concatenate([at[seen] + rng.normal(0, 0.005, (len(seen), 3)), false])
        order = rng.permutation(len(points))
        found.append(points[order])
        labels.append(np.concatenate([seen, np.full(len(false), -1)])[order])
    d = am.Detections.from_frames(np.arange(frames, dtype=float), found)
    now = float(np.prod(places[0].max(0) - places[0].min(0) + 0.6))
    assert now <= float(np.prod(size))
    model = am.TrackingModel(
        motion=am.DWNA(acceleration_sigma=0.006, velocity_sigma=0.04),
        sensor=am.Sensor(noise_sigma=0.005, p_detection=0.9, clutter_density=0.1 * n / now),
        population=am.Population(
            birth_density=0.05 / now, p_disappear=0.001, max_speed=0.12, max_gap=8
        ),
    )
    return am.Tracks(detections=d, labels=np.concatenate(labels).astype(np.int64)), model


def throughput(seeds: int) -> list[list[str]]:
    rows: list[list[str]] = []
    for n, frames in SIZES:
        scenes = [smooth(n, frames, seed) for seed in range(seeds)]
        oracles = [(am.metrics.oracle_tracks(truth, 8), truth, model) for truth, model in scenes]
        oracle = np.mean([am.evaluate(one, truth).idf1 for one, truth, _ in oracles])
        true = [am.log_posterior(one, model) for one, _, model in oracles]
        for name, method in METHODS.items():
            fps: list[float] = []
            e: list[am.metrics.Evaluation] = []
            value: list[float] = []
            for truth, model in scenes:
                start = time.perf_counter()
                tracks = am.track(truth.detections, method, model=model, seed=1)
                fps.append(frames / (time.perf_counter() - start))
                e.append(am.evaluate(tracks, truth))
                value.append(tracks.info["log_posterior"])
            above = np.array(value) - true
            rows.append(
                [f"{n} markers, {frames} frames, {name}", f"{np.median(fps):,.0f}",
                 f"{np.mean([one.idf1 for one in e]):.4f}", f"{oracle:.4f}",
                 f"{np.mean([one.wrong_percent for one in e]):.3f}",
                 f"{np.mean([one.missing_percent for one in e]):.3f}",
                 f"{sum(one.wrong_percent == 0 for one in e)}", f"{above.mean():+.1f}",
                 f"{(above > -1e-6).sum()}"]
            )  # fmt: skip
            print(*rows[-1], flush=True)
    return rows


def latency(rate: float) -> list[list[str]]:
    """Time of each step of a stream of 53 markers."""
    truth, model = smooth(53, 3000, 1)
    frames = list(truth.detections)
    rows: list[list[str]] = []
    for name, method in (
        ("53 markers, without confidence", am.MCMCDA(end_odds=1, confidence=0)),
        ("53 markers", am.MCMCDA(end_odds=1)),
        (
            f"53 markers, deadline={0.5 / rate:.4f}",
            am.MCMCDA(end_odds=1, deadline=0.5 / rate),
        ),
    ):
        state = method.init(model, seed=1)
        taken: list[float] = []
        for now, points in frames:
            start = time.perf_counter()
            state, _ = method.step(state, now, points)
            taken.append(1e3 * (time.perf_counter() - start))
        edges = [0.5, 1.0, 2.0, 1e3 / rate]
        shares = [100 * float(np.mean(np.array(taken) <= edge)) for edge in edges]
        rows.append([name, *(f"{np.percentile(taken, q):.2f}" for q in (50, 99, 99.9, 100)),
                     *(f"{share:.2f}" for share in shares)])  # fmt: skip
    return rows


def whole_captures(lengths: list[int]) -> list[list[str]]:
    """Processor time of whole captures, and the most memory so far; lengths in rising order."""
    rows: list[list[str]] = []
    for frames in sorted(lengths):
        truth, model = smooth(50, frames, 1)
        start = time.process_time()
        tracks = am.track(truth.detections, am.MCMCDA(window=None), model=model, seed=1)
        seconds = time.process_time() - start
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        idf1 = am.evaluate(tracks, truth).idf1
        rows.append([f"{frames}", f"{seconds:.1f}", f"{1e3 * seconds / frames:.2f}",
                     f"{memory:.0f}", f"{idf1:.4f}"])  # fmt: skip
        print(*rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--lengths", type=int, nargs="+")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    if options.lengths:
        head = ["frames", "seconds", "ms a frame", "memory, MB", "IDF1"]
        lines = [*table(head, whole_captures(options.lengths)), "", f"{conditions()}."]
        publish(lines, options.markdown)
        return
    head = ["", "frames a second", "IDF1", "oracle", "% wrong", "% missing", "scenes, none wrong",
            "log posterior over the truth's", "scenes in which it is no less"]  # fmt: skip
    lines = table(head, throughput(options.seeds))
    frame = 1e3 / 240
    head = ["ms a step, streaming", "median", "99 %", "99.9 %", "most", "% ≤ 0.5", "% ≤ 1", "% ≤ 2",
            f"% ≤ {frame:.2f}, a frame at 240 Hz"]  # fmt: skip
    lines += ["", *table(head, latency(240.0)), "", f"{options.seeds} scenes. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
