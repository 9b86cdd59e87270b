"""A capture without names in, identified trajectories out, and how good they are.

Simulated here so that the truth is known; for a real one, start with ``am.read("trial.c3d")``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import asterism as am


def main(folder: Path) -> None:
    scene = am.simulate.crossing(seed=3, rate=100)
    truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.002, seed=4)
    capture = truth.detections  # points without names

    estimate = am.estimate_model(capture)
    print(estimate)
    tracks = am.track(capture, am.GNN(), model=estimate.model)
    am.write(tracks, folder / "crossing.c3d")

    again = am.io.read_tracks(folder / "crossing.c3d")
    print(am.evaluate(again, truth))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path())
