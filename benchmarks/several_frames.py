"""Methods that weigh several frames at once: what they find, what they cost, and their memory.

python benchmarks/several_frames.py [--seeds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from methods import METHODS
from report import conditions, publish, table
from speed import model_of

SEVERAL: dict[str, am.tracking.Method[Any]] = {
    "tomht": am.TOMHT(),
    "mht": am.MHT(),
    "mda": am.MDA(),
    "mda, window=4": am.MDA(window=4),
}


def posterior_and_identities(scene: str, seeds: int) -> list[list[str]]:
    """10 % missing, 10 % clutter, 5 mm of noise; the model is read off the clip."""
    found: dict[str, list[tuple[float, ...]]] = {}
    for seed in range(seeds):
        clean = am.simulate.SCENES[scene].make(seed=seed)
        truth = am.simulate.corrupt(clean, missing=0.1, clutter=0.1, noise=0.005, seed=seed)
        model = am.estimate_model(truth.detections).model
        oracle = am.metrics.oracle_tracks(truth, model.population.max_gap)
        best = am.log_posterior(oracle, model)
        results = {"oracle": oracle} | {
            name: am.track(truth.detections, method, model=model)
            for name, method in (METHODS | SEVERAL).items()
        }
        for name, tracks in results.items():
            e = am.evaluate(tracks, truth)
            more = am.log_posterior(tracks, model) - best
            found.setdefault(name, []).append(
                (more, e.idf1, e.switches_per_1000, e.wrong_percent, e.n_tracks)
            )
    rows: list[list[str]] = []
    for name, figures in found.items():
        more, idf1, switches, wrong, n = np.array(figures).T
        rows.append(
            [
                name,
                f"{more.mean():+.1f} ± {more.std():.1f}",
                f"{idf1.mean():.4f}",
                f"{switches.mean():.2f}",
                f"{wrong.mean():.2f}",
                f"{n.mean():.1f}",
            ]
        )
    return rows


def cost() -> list[list[str]]:
    """Give time and hypotheses as markers and clutter grow."""
    rows: list[list[str]] = []
    for n_markers, n_frames in ((8, 400), (50, 200), (200, 60)):
        scene = am.simulate.smooth(n_markers=n_markers, frames=n_frames, seed=1)
        for clutter in (0.0, 0.1, 0.25, 0.5):
            truth = am.simulate.corrupt(scene, missing=0.1, clutter=clutter, noise=0.005, seed=2)
            row = [str(n_markers), f"{100 * clutter:.0f} %"]
            for name, method in SEVERAL.items():
                start = time.perf_counter()
                tracks = am.track(truth.detections, method, model=model_of(truth, 3))
                taken = (time.perf_counter() - start) / n_frames
                info = tracks.info
                size = f"{info['largest_group']:.0f}"
                if name in ("tomht", "mht"):
                    size += f" ({info['most_hypotheses']:.0f})"
                limit = info["max_dropped_odds"] if name == "mht" else info["gap"]
                row += [f"{1e3 * taken:.2f}", size, f"{limit:.1g}"]
            rows.append(row)
            print(*row, flush=True)
    return rows


def gaps() -> list[str]:
    """Quantiles of the gap of the relaxation, over windows of a crowd."""
    found: list[tuple[float, float]] = []
    rng = np.random.default_rng(1)
    for _ in range(1000):
        n, S = int(rng.integers(3, 9)), int(rng.integers(3, 6))
        tuples = np.unique(rng.integers(-1, n, (20 * n, S)), axis=0)
        tuples = tuples[(tuples >= 0).sum(axis=1) >= 2]
        weights = rng.exponential(1.0, len(tuples)) * (tuples >= 0).sum(axis=1)
        exact = am.solve.assign_multidimensional(tuples, weights)
        relaxed = am.solve.assign_multidimensional(tuples, weights, method="relaxed")
        assert relaxed.value <= exact.value + 1e-6 <= relaxed.bound + 2e-6
        found.append((relaxed.gap / exact.value, (exact.value - relaxed.value) / exact.value))
    gap, short = np.array(found).T
    levels = (0.1, 0.5, 0.9, 0.99, 1.0)
    head = ["1000 random problems, 3 to 8 indices in 3 to 5 dimensions", "10 %", "median", "90 %",
            "99 %", "most"]  # fmt: skip
    return table(
        head,
        [
            [name, *(f"{100 * np.quantile(x, q):.2f} %" for q in levels)]
            for name, x in (("gap it tells", gap), ("below the optimum", short))
        ],
    )


def resident() -> float:
    """Memory of this process now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def hour(name: str, method: am.tracking.Method[Any], rate: float) -> list[str]:
    """Stream an hour of eight markers, step by step, a minute made at a time."""
    minute = am.simulate.smooth(n_markers=8, frames=int(60 * rate), rate=1.0, seed=1)
    state = None
    memory: list[float] = []
    n, start = 0, time.perf_counter()
    for number in range(60):
        truth = am.simulate.corrupt(minute, missing=0.1, clutter=0.1, noise=0.005, seed=number)
        if state is None:
            state = method.init(model_of(truth, 3))
        for _, points in truth.detections:
            state, _ = method.step(state, float(n), points)
            n += 1
        memory.append(resident())
    seconds = time.perf_counter() - start
    return [
        name,
        f"{n:,}",
        f"{memory[4]:.0f}",
        f"{memory[29]:.0f}",
        f"{memory[-1]:.0f}",
        f"{1e3 * seconds / n:.2f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    lines: list[str] = []
    head = ["method", "log posterior − oracle's", "IDF1", "switches / 1000", "% wrong", "tracks"]
    for scene, n in (("cube", 8), ("crossing", 16)):
        lines += [f"Scene `{scene}`, {n} markers, means over {options.seeds} seeds:", ""]
        lines += [*table(head, posterior_and_identities(scene, options.seeds)), ""]
        print("\n".join(lines), flush=True)
    lines += [
        "Milliseconds a frame, the largest cluster of trees (and its most hypotheses), and what"
    ]
    lines += ["was cut short: the greatest gap in nats or, of mht, odds of what was left out:", ""]
    head = [
        "markers",
        "clutter",
        *(f"{n}{x}" for n in SEVERAL for x in (", ms", ", size", ", cut")),
    ]
    lines += [*table(head, cost()), ""]
    lines += ["Lagrangian relaxation beside the exact solver:", "", *gaps(), ""]
    lines += ["An hour streamed, 8 markers, memory of the process in MB:", ""]
    head = ["method", "frames", "after 5 min", "after 30 min", "after 60 min", "ms a frame"]
    rates = {"tomht": 100.0, "mht": 100.0, "mda": 10.0}
    lines += [*table(head, [hour(name, SEVERAL[name], rate) for name, rate in rates.items()]), ""]
    lines += [f"{conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
