"""Speed of the frame-by-frame methods beside a SciPy + NumPy loop, in one process, on one core.

Scene: `simulate.smooth`, 10 % missing, 10 % clutter, noise 0.005; model with one motion at the
scene's own scale, and the same with three. Frames per second are those of the association alone,
and each figure is the best of several runs. The time of a move is that of the report's chain on the
report's cube (10 % missing, 10 % clutter): the difference between 250 and 25 moves a frame and
marker, over the moves.

    python benchmarks/speed.py [--markdown FILE]
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import asterism as am
from asterism.tracking.methods.associate import associate
from methods import METHODS
from peers.numpy_loop import track_in_numpy
from report import best_of, conditions, publish

SIZES = ((8, 20_000), (50, 4_000), (200, 1_000), (1000, 200))


def model_of(capture: am.Tracks, motions: int) -> am.TrackingModel:
    """Give the scene's own rates, and one or three motions around its acceleration."""
    extent = float(np.prod(np.ptp(capture.detections.points, axis=0)))
    n_frames = capture.detections.n_frames
    levels = (0.006,) if motions == 1 else (0.003, 0.006, 0.06)
    single = tuple(am.DWNA(acceleration_sigma=a, velocity_sigma=0.03) for a in levels)
    motion: am.model.Motion = single[0]
    if motions == 3:
        motion = am.InteractingMotions(
            models=single,
            transitions=np.array([[0.95, 0.045, 0.005], [0.045, 0.95, 0.005], [0.25, 0.25, 0.5]]),
        )
    clutter = max(float((capture.labels < 0).sum()), 1.0) / n_frames / extent
    return am.TrackingModel(
        motion=motion,
        sensor=am.Sensor(noise_sigma=0.005, p_detection=0.9, clutter_density=clutter),
        population=am.Population(
            birth_density=1 / extent / n_frames, p_disappear=1e-5, max_speed=0.2, max_gap=8
        ),
    )


def step_times(detections: am.Detections, model: am.TrackingModel) -> list[float]:
    """Time of each streaming step, seconds."""
    method = am.GNN()
    state = method.init(model)
    taken: list[float] = []
    for now, points in list(detections)[:2000]:
        start = time.perf_counter()
        state, _ = method.step(state, now, points)
        taken.append(time.perf_counter() - start)
    return taken


def beside_the_loop(d: am.Detections, model: am.TrackingModel) -> list[str]:
    """Time the NumPy loop on the first frames; ours against it, and the share of equal labels."""
    n = max(d.n_frames // 10, 20)
    first = am.Detections(
        times=d.times[:n], offsets=d.offsets[: n + 1], points=d.points[: d.offsets[n]]
    )
    ours = best_of(3, lambda: associate(am.GNN(), first, model, score=False))
    theirs = best_of(2, lambda: track_in_numpy(first, model))
    same = track_in_numpy(first, model) == associate(am.GNN(), first, model).labels
    return [f"{n / theirs:,.0f}", f"{theirs / ours:.0f} ×", f"{100 * same.mean():.2f} %"]


def row_of(capture: am.Tracks, n_markers: int, motions: int) -> list[str]:
    d, model = capture.detections, model_of(capture, motions)
    row = [str(n_markers), str(motions)]
    for method in METHODS.values():
        seconds = best_of(3, lambda m=method: associate(m, d, model, seed=0, score=False))
        idf1 = am.evaluate(associate(method, d, model, seed=0), capture).idf1
        row.append(f"{d.n_frames / seconds:,.0f} ({idf1:.4f})")
    taken = step_times(d, model)
    row += [f"{statistics.median(taken) * 1e3:.3f}", f"{np.quantile(taken, 0.99) * 1e3:.3f}"]
    return row + (beside_the_loop(d, model) if motions == 1 else ["–"] * 3)


def frames_a_second() -> list[list[str]]:
    rows: list[list[str]] = []
    for n_markers, n_frames in SIZES:
        scene = am.simulate.smooth(n_markers=n_markers, frames=n_frames, seed=1)
        capture = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.005, seed=2)
        rows += [row_of(capture, n_markers, motions) for motions in (1, 3)]
    return rows


def move_seconds(n_motions: int) -> float:
    """Time of a move of the report's chain."""
    cube = am.simulate.corrupt(am.simulate.cube(seed=1), missing=0.1, clutter=0.1, seed=2)
    model = am.estimate_model(cube.detections).model
    three = model.motion
    assert isinstance(three, am.InteractingMotions)
    model = replace(model, motion=three.models[-1] if n_motions == 1 else three)
    seconds, n_moves = [], []
    for moves in (25, 250):
        chain = am.MCMCDA.report_2010(moves=moves)
        seconds.append(best_of(5, lambda c=chain: associate(c, cube.detections, model)))
        n_moves.append(associate(chain, cube.detections, model).info["moves"])
    return (seconds[1] - seconds[0]) / (n_moves[1] - n_moves[0])


def import_seconds(code: str) -> float:
    """Time of a fresh interpreter that runs `code`, less that of an empty one; median of five."""

    def run(text: str) -> float:
        return statistics.median(
            best_of(1, lambda: subprocess.run([sys.executable, "-c", text], check=True))
            for _ in range(5)
        )

    return run(code) - run("pass")


TEN_MINUTES = """
import resource, asterism as am
scene = am.simulate.smooth(n_markers=100, frames=72000, rate=120, seed=1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
tracks = am.track(scene.detections, am.GNN())
print(before, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, tracks.n_tracks)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    head = [
        "markers", "motions", *(f"{name}: frames/s (IDF1)" for name in METHODS),
        "GNN step ms (median)", "(99 %)", "NumPy loop frames/s", "GNN against it", "same labels",
    ]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + "---:|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in frames_a_second()]
    light = import_seconds("import asterism")
    c3d = import_seconds("import asterism; asterism.read")
    out = subprocess.run(
        [sys.executable, "-c", TEN_MINUTES], check=True, capture_output=True, text=True
    ).stdout.split()
    lines += [
        "",
        f"`import asterism`: {light:.2f} s; with reading C3D: {c3d:.2f} s. Ten minutes of 100 "
        f"markers at 120 Hz, model estimated and tracked: peak memory {int(out[1]) / 1e6:.2f} GB, "
        f"of which {int(out[0]) / 1e6:.2f} GB were there with the capture alone; {out[2]} tracks.",
        "",
        "A move of the report's chain, on its cube: "
        f"{1e6 * move_seconds(1):.3f} µs with one motion, {1e6 * move_seconds(3):.3f} with three.",
        "",
        f"{conditions()}; one core.",
    ]
    publish(lines, options.markdown)


if __name__ == "__main__":
    main()
