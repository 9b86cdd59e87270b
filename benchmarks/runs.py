"""Misses in runs: every method with a model of independent misses, and with one that has P_r.

People and a juggler before four cameras, seen past their limbs by two or more of them (10 % of the
detections missing besides, 10 % clutter, 0.3 mm of noise), and the real captures as captured. IDF1
with independent misses → with runs. Finds the captures in ``../shared/data`` beside the project.

    python benchmarks/runs.py [--data FOLDER] [--seeds N] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from captures import captures, named_only
from methods import METHODS
from report import conditions, publish, table
from scenes import CASES, sensed

if TYPE_CHECKING:
    from collections.abc import Iterator

CAMERAS = "before four cameras"
CAPTURED = "as captured"


def clips(folder: Path, seeds: int) -> Iterator[tuple[str, str, am.Tracks]]:
    """Give kind, name and truth of every clip."""
    for name, (_, _, _, has_cameras) in CASES.items():
        for seed in range(seeds if has_cameras else 0):
            yield CAMERAS, name, sensed(name, seed, through_cameras=True)
    for path in captures(folder):
        capture = am.read(path)
        if any(capture.names):
            yield CAPTURED, path.name, named_only(capture.tracks)


def true_rates(truth: am.Tracks, max_gap: int) -> tuple[float, float]:
    """P_d and P_r as the truth has them, of gaps that a track may bridge."""
    order, _ = truth.by_track
    frame = truth.detections.frame_of[order]
    gap = np.diff(frame)[np.diff(truth.labels[order]) == 0]
    gap = gap[gap <= max_gap]
    hidden = gap > 1
    missed = (gap - 1).sum()
    return 1 - hidden.mean(), hidden.sum() / missed if missed else np.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    rows: list[list[str]] = []
    for kind, name, truth in clips(options.data, options.seeds):
        if options.only not in name:
            continue
        d = truth.detections
        single = am.estimate_model(d).model
        runs = am.estimate_model(d, misses="runs").model
        P_d, P_r = true_rates(truth, runs.population.max_gap)
        said = runs.sensor.p_redetection
        row = [name, f"{P_d:.4f}, {P_r:.2f}".replace("nan", "–")]
        row.append(f"{runs.sensor.p_detection:.4f}, " + ("P_d" if said is None else f"{said:.2f}"))
        for method, maker in METHODS.items():
            before = am.evaluate(am.track(d, maker, model=single), truth).idf1
            after = before
            if said is not None:
                after = am.evaluate(am.track(d, maker, model=runs), truth).idf1
            found.setdefault((kind, method), []).append((before, after))
            row.append(f"{before:.3f} → {after:.3f}")
        rows.append(row)
        print(*row, sep=" | ", flush=True)
    head: list[list[str]] = []
    for kind in (CAMERAS, CAPTURED):
        means = [np.mean(found[kind, m], axis=0) for m in METHODS if (kind, m) in found]
        if means:
            head.append([kind, *(f"{a:.4f} → {b:.4f}" for a, b in means)])
    lines = ["Mean IDF1, misses independent → in runs:", ""]
    lines += [*table(["", *METHODS], head), "", "Each:", ""]
    lines += table(["clip", "true P_d, P_r", "learnt", *METHODS], rows)
    lines += ["", f"Seeds of each scene: {options.seeds}. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
