"""The 2010 report's tests of the stable marriage (§5.6), by its own method and beside it GNN.

Every marker is seen in every frame, with 1 mm of noise. A link is wrong if a marker's label is not
that of the frame before. The report does not say how strongly its last walk is attracted: it is
shown at four strengths.

    python benchmarks/report_smp.py [--seeds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from report import publish

if TYPE_CHECKING:
    from numpy.typing import NDArray

NOISE, STRIDE = 0.001, 0.02
METHODS = {"SMP strict": am.SMP(strict=True), "GNN": am.GNN()}


def model_of(motion: am.Motion) -> am.TrackingModel:
    return am.TrackingModel(
        motion=motion,
        sensor=am.Sensor(noise_sigma=NOISE, p_detection=0.999, clutter_density=1e-6),
        population=am.Population(birth_density=1e-6, p_disappear=1e-6, max_speed=10.0, max_gap=3),
    )


def wrong_links(truth: am.Tracks, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the wrong links of each frame but the first, shape (T - 1,)."""
    dense = np.full((truth.detections.n_frames, truth.n_tracks), -1)
    dense[truth.detections.frame_of, truth.labels] = labels
    return (dense[1:] != dense[:-1]).sum(axis=1)


def walks(seeds: int) -> list[list[str]]:
    rows: list[list[str]] = []
    motions = {
        "DWNA": am.DWNA(acceleration_sigma=STRIDE, velocity_sigma=0.03),
        "random walk": am.RandomWalk(walk_sigma=STRIDE),
    }
    for pull in (0.0, 0.005, 0.02, 0.1):
        for named, motion in motions.items():
            for name, method in METHODS.items():
                found: list[NDArray[np.int64]] = []
                for seed in range(seeds):
                    scene = am.simulate.walk(frames=200, stride=STRIDE, pull=pull, seed=seed)
                    truth = am.simulate.sense(scene, noise=NOISE, seed=seed)
                    tracks = am.track(truth.detections, method, model=model_of(motion))
                    found.append(wrong_links(truth, tracks.labels))
                counts = np.bincount(np.concatenate(found), minlength=9)
                share = [f"{100 * c / counts.sum():.1f}" for c in counts[:9]]
                rows.append([f"{pull:g}", named, name, *share])
    return rows


def first_three(seeds: int) -> list[str]:
    """Run the tests that the report says were all correct, and time them."""
    lines: list[str] = []
    cases = {
        "8 points of variable speed and direction": ("wander", 0.01),
        "two cubes, one through the other": ("crossing", 0.002),
    }
    for about, (scene, acceleration) in cases.items():
        motion = am.DWNA(acceleration_sigma=acceleration, velocity_sigma=0.03)
        n_right = n_frames = 0
        seconds: list[float] = []
        for seed in range(seeds):
            truth = am.simulate.sense(
                am.simulate.SCENES[scene].make(frames=100, seed=seed), noise=NOISE, seed=seed
            )
            start = time.perf_counter()
            tracks = am.track(truth.detections, METHODS["SMP strict"], model=model_of(motion))
            seconds.append(time.perf_counter() - start)
            wrong = wrong_links(truth, tracks.labels)
            n_right, n_frames = n_right + int((wrong == 0).sum()), n_frames + len(wrong)
        share = f"{100 * n_right / n_frames:.2f} % of the frames all correct"
        lines.append(f"- {about}: {share}; 100 frames take {1e3 * min(seconds):.1f} ms.")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = ["pull", "motion model", "method", "0 wrong %", *(str(n) for n in range(1, 9))]
    lines = [*first_three(options.seeds), "", "| " + " | ".join(head) + " |"]
    lines += ["|---|---|---|" + "---:|" * 9]
    lines += ["| " + " | ".join(row) + " |" for row in walks(options.seeds)]
    reported = ("82", "–", "11", "2.5", "2.5", "0.5", "0.5", "0.5", "0.5")
    lines += [f"| ? | DWNA | the report's SMP | {' | '.join(reported)} |"]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
