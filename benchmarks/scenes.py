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
from report import conditions, publish

METHODS = (am.GNN(), am.SMP())

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
    return am.simulate.sense(truth, missing=0.1, clutter=0.1, noise=noise, rig=rig, seed=seed)


def rows_of(case: str, seeds: int, *, through_cameras: bool) -> list[list[str]]:
    found: dict[str, list[tuple[float, ...]]] = {method.name: [] for method in METHODS}
    floors: list[float] = []
    seen: list[float] = []
    for seed in range(seeds):
        truth = sensed(case, seed, through_cameras=through_cameras)
        model = am.estimate_model(truth.detections).model
        floor = am.floor(truth, model.population.max_gap)
        floors.append(am.evaluate(floor, truth).idf1)
        seen.append(float((truth.labels >= 0).sum()) / truth.detections.n_frames / truth.n_tracks)
        for method in METHODS:
            e = am.evaluate(am.track(truth.detections, method, model=model), truth)
            figures = (e.idf1, e.switches_per_1000, e.n_tracks / e.n_markers)
            found[method.name].append(figures)
    name = f"{case}, 4 cameras" if through_cameras else case
    row = [name, f"{100 * np.mean(seen):.0f} %", f"{np.mean(floors):.3f}"]
    for method in METHODS:
        idf1, switches, tracks = np.array(found[method.name]).T
        row += [f"{idf1.mean():.3f} ± {idf1.std():.3f}", f"{switches.mean():.1f}"]
        row += [f"{tracks.mean():.2f}"]
    return [row]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default="")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for case, (_, _, _, has_cameras) in CASES.items():
        if options.only in case:
            for through_cameras in (False, True)[: 1 + has_cameras]:
                rows += rows_of(case, options.seeds, through_cameras=through_cameras)
                print(*rows[-1], flush=True)
    head = ["scene", "seen", "floor d̄"]
    for method in METHODS:
        head += [f"{method.name} IDF1", "switches / 1000", "tracks/true"]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines += [
        "",
        f"Means over {options.seeds} seeds, ± the standard deviation between them. {conditions()}.",
    ]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
