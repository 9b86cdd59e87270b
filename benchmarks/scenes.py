"""Every scene, sensed and tracked by every method with the estimated model; means over seeds.

10 % of the detections missing, 10 % clutter, noise of 5 mm for the scenes of points and 0.3 mm for
those in metres and seconds. People are tracked a second time from what two or more of four cameras
see past their limbs.

    python benchmarks/scenes.py [--seeds N] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from methods import METHODS, LinkConfidence
from report import conditions, publish, table

# What is made, and the noise in metres; a rig where the scene is also seen through cameras.
CASES: dict[str, tuple[str, dict[str, Any], float, bool]] = {
    "cube": ("cube", {}, 0.005, False),
    "crossing": ("crossing", {}, 0.005, False),
    "wander": ("wander", {}, 0.005, False),
    "walk": ("walk", {}, 0.005, False),
    "attracted": ("attracted", {}, 0.005, False),
    "smooth, 50": ("smooth", {"n_markers": 50, "frames": 200}, 0.005, False),
    "smooth, 200": ("smooth", {"n_markers": 200, "frames": 100}, 0.005, False),
    "swarm": ("swarm", {}, 3e-4, False),
    "person walks": ("person", {"activity": "walk"}, 3e-4, True),
    "person runs": ("person", {"activity": "run"}, 3e-4, True),
    "person jumps": ("person", {"activity": "jump"}, 3e-4, True),
    "person turns": ("person", {"activity": "turn"}, 3e-4, True),
    "two people cross": ("two_people", {"activity": "cross"}, 3e-4, True),
    "two people hug": ("two_people", {"activity": "hug"}, 3e-4, True),
    "fingers": ("fingers", {}, 3e-4, False),
    "juggler": ("juggler", {}, 3e-4, True),
}


def sensed(case: str, seed: int, *, through_cameras: bool) -> am.Tracks:
    scene, options, noise, _ = CASES[case]
    truth = am.simulate.SCENES[scene].make(seed=seed, **options)
    rig = None
    if through_cameras:
        points = truth.detections.points
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        reach = 3.0 + float(np.ptp(points[:, :2], axis=0).max())
        rig = am.Rig.ring(4, radius=reach, height=2.8, target=middle)
    return am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=noise, rig=rig, seed=seed)


def row_of(
    case: str, seeds: int, confidence: LinkConfidence, *, through_cameras: bool
) -> tuple[list[str], list[str]]:
    """Give the scores of every method, and the tracks that each found for one marker."""
    found: dict[str, list[tuple[float, ...]]] = {name: [] for name in METHODS}
    oracles: list[float] = []
    seen: list[float] = []
    for seed in range(seeds):
        truth = sensed(case, seed, through_cameras=through_cameras)
        model = am.estimate_model(truth.detections).model
        oracle = am.metrics.oracle_tracks(truth, model.population.max_gap)
        oracles.append(am.evaluate(oracle, truth).idf1)
        seen.append(float((truth.labels >= 0).sum()) / truth.detections.n_frames / truth.n_tracks)
        for name, method in METHODS.items():
            tracks = am.track(truth.detections, method, model=model)
            e = am.evaluate(tracks, truth)
            figures = (e.idf1, e.switches_per_1000, e.n_tracks / e.n_markers)
            found[name].append(figures)
            confidence.add(name, tracks, truth)
    scene = f"{case}, 4 cameras" if through_cameras else case
    row = [scene, f"{100 * np.mean(seen):.0f} %", f"{np.mean(oracles):.3f}"]
    each = [scene]
    for name in METHODS:
        idf1, switches, tracks = np.array(found[name]).T
        row.append(f"{idf1.mean():.3f} ± {idf1.std():.3f} ({switches.mean():.1f})")
        each.append(f"{tracks.mean():.2f}")
    return row, each


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    ratios: list[list[str]] = []
    confidence = LinkConfidence()
    for case, (_, _, _, has_cameras) in CASES.items():
        if options.only in case:
            for through_cameras in (False, True)[: 1 + has_cameras]:
                row, each = row_of(case, options.seeds, confidence, through_cameras=through_cameras)
                rows.append(row)
                ratios.append(each)
                print(*row, flush=True)
    lines = ["IDF1 ± its standard deviation between seeds, and switches for 1000 detections:", ""]
    lines += [*table(["scene", "seen", "oracle d̄", *METHODS], rows), ""]
    lines += ["Tracks found for each true one:", "", *table(["scene", *METHODS], ratios), ""]
    lines += ["Confidence of the links of all scenes, where a method has any:", ""]
    lines += [*confidence.table(), ""]
    lines += [f"Means over {options.seeds} seeds. {conditions()}."]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
