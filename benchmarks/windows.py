"""MCMCDA by the length of its window, with as many moves for each ambiguous link.

Markers that attract each other (`am.simulate.attracted`), 150 frames, 10 % missed, 10 % clutter,
2 mm of noise. A window of n frames has 10 n moves for each ambiguous detection of a new frame, as
it has so many more ambiguous links.

    python benchmarks/windows.py [--scenes N] [--seeds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import asterism as am
from report import conditions, publish, table

FRAMES, WINDOWS, USUAL = 150, (5, 10, 20, 40), 10


def corrupted(seed: int) -> tuple[am.Tracks, am.TrackingModel]:
    """Return a scene with misses, clutter and noise, and the model estimated from it."""
    scene = am.simulate.attracted(frames=FRAMES, seed=seed)
    truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=2e-3, seed=seed)
    return truth, am.estimate_model(truth.detections).model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    scenes = [corrupted(11 + k) for k in range(options.scenes)]
    found: dict[int, np.ndarray] = {}
    for window in WINDOWS:
        method = am.MCMCDA(window=window, moves=10 * window, confidence=0, end_odds=1)
        runs: list[list[tuple[float, float, float]]] = []
        for truth, model in scenes:
            runs.append([])
            for seed in range(options.seeds):
                start = time.process_time()
                tracks = am.track(truth.detections, method, model=model, seed=seed)
                ms = 1e3 * (time.process_time() - start) / FRAMES
                value = tracks.info["log_posterior"]
                runs[-1].append((value, am.evaluate(tracks, truth).idf1, ms))
        found[window] = np.mean(runs, axis=1)
        print(window, found[window].mean(axis=0).round(3), flush=True)
    rows: list[list[str]] = []
    for window, by_scene in found.items():
        more = by_scene[:, 0] - found[USUAL][:, 0]
        error = np.std(more, ddof=1) / np.sqrt(len(more))
        value, idf1, ms = by_scene.mean(axis=0)
        gain = "" if window == USUAL else f"{more.mean():+.1f} ± {error:.1f}"
        rows.append(
            [str(window), str(10 * window), f"{value:.1f}", gain, f"{idf1:.3f}", f"{ms:.2f}"]
        )
    head = ["window", "moves", "log posterior", f"against {USUAL} frames", "IDF1", "ms a frame"]
    lines = [*table(head, rows), ""]
    lines.append(f"{options.scenes} scenes, {options.seeds} seeds each. {conditions()}.")
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
