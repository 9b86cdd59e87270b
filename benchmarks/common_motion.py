"""Markers that move together: tracks with and without the motion in common.

Simulated skin: 19 markers about 20 mm apart, at 120 Hz, with 3 mm of independent noise. They move
together by 7 or 12 mm in a step (median), and each has a smooth motion of its own besides, of 3 or
6 mm (standard deviation of each of four oscillations, over two). And a simulated hand, 23 markers
on moving fingers, that moves as a whole as much. Clean, and with 10 % missing and 10 % clutter.
Compared are `am.track`, the same with the motion in common, and MCMCDA with 200 moves. Means of
seeds.

    python benchmarks/common_motion.py [--seeds 21 22 23] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np

import asterism as am
from asterism.tracking import plan
from asterism.tracking.attempts import most_certain
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

N_MARKERS, N_FRAMES, RATE, NOISE = 19, 600, 120.0, 3e-3
APART = 0.015
"""Least distance of two markers at rest, metres."""
SIZES = (0.066, 0.12)
"""Size of the motion in common, metres."""
OWN = (0.003, 0.006)


def smooth(
    rng: np.random.Generator, spread: float, rate: float, shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """Return four oscillations about this rate, shape (T, *shape)."""
    t = np.arange(N_FRAMES) / RATE
    total = np.zeros((N_FRAMES, *shape))
    for f in rng.uniform(0.5 * rate, 1.5 * rate, 4):
        angle = 2 * np.pi * (f * t[(..., *[None] * len(shape))] + rng.uniform(size=shape))
        total += spread / 2 * rng.normal(size=shape) * np.sin(angle)
    return total


def skin(size: float, own: float, seed: int) -> am.Tracks:
    """Simulate markers on skin: a motion in common, and one of each marker's own."""
    rng = np.random.default_rng(seed)
    rest = np.empty((0, 3))
    while len(rest) < N_MARKERS:
        new = rng.uniform([-0.05, -0.04, -0.01], [0.05, 0.04, 0.01])
        if (np.linalg.norm(rest - new, axis=1) > APART).all():
            rest = np.vstack([rest, new])
    common = smooth(rng, size, 1.6, (3,))[:, None]
    positions = rest + common + smooth(rng, own, 2.0, (N_MARKERS, 3))
    return am.Tracks.from_dense(np.arange(N_FRAMES) / RATE, positions)


def hand(size: float, seed: int) -> am.Tracks:
    """Simulate a hand with moving fingers that moves as a whole besides."""
    fingers = am.simulate.fingers(frames=N_FRAMES, rate=RATE, seed=seed)
    common = smooth(np.random.default_rng(seed), size, 1.6, (3,))[:, None]
    return am.Tracks.from_dense(fingers.detections.times, fingers.positions() + common)


def with_it(d: am.Detections) -> am.Tracks:
    """Track with the motion in common."""
    with (
        mock.patch.object(plan, "choice_without_common_motion", return_value=None),
        mock.patch.object(most_certain, "choice_without_common_motion", return_value=None),
    ):
        return am.track(d)


def row(scene: list[str], takes: dict[int, am.Tracks], share: float) -> list[str]:
    """Track one kind of scene, by seed, and return the row of the table."""
    figures: list[list[tuple[float, float]]] = []
    steps, n_removed = [], 0
    for seed, take in takes.items():
        steps.append(np.median(np.linalg.norm(np.diff(take.positions(), axis=0), axis=2)))
        truth = am.simulate.corrupt(take, missing=share, clutter=share, noise=NOISE, seed=seed)
        d = truth.detections
        default = am.track(d)
        assert default.recipe is not None
        n_removed += default.recipe.common_motion
        ways = (default, with_it(d), am.track(d, am.MCMCDA(moves=200)))
        found = [am.evaluate(tracks, truth) for tracks in ways]
        figures.append([(each.idf1, each.switches_per_1000) for each in found])
    means = np.mean(figures, axis=0)
    scene = [*scene, f"{1e3 * np.mean(steps):.0f}", f"{100 * share:.0f} %"]
    scene.append(f"{n_removed} of {len(takes)}")
    return scene + [f"{idf1:.3f} / {rate:.1f}" for idf1, rate in means]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[21, 22, 23])
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for size in SIZES:
        kinds = [
            (
                [f"skin, own motion {1e3 * own:.0f} mm"],
                {k: skin(size, own, k) for k in options.seeds},
            )
            for own in OWN
        ]
        kinds.append((["hand"], {k: hand(size, k) for k in options.seeds}))
        for scene, takes in kinds:
            for share in (0.0, 0.1):
                rows.append(row(scene, takes, share))
                print(*rows[-1], sep=" | ", flush=True)
    head = ["scene", "step, mm", "missing and clutter", "removed"]
    head += [f"{name}: IDF1 / switches per 1000" for name in ("default", "with it", "MCMCDA")]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
