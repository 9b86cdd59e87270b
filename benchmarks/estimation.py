"""How near the model from the clip comes, and how honest its standard deviations are.

Scenes are drawn from the generative model itself, so that every parameter has a true value; the
figures are the root mean square of z, the error in stated standard deviations, and the median of
the relative error. Prints Markdown.

    python benchmarks/estimation.py [--seeds N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

import asterism as am
from report import publish, table

EDGE = 2.0  # metres, of the cube in which markers begin and clutter lies
STEP = 0.01


@dataclass(frozen=True, kw_only=True)
class World:
    """Markers that move by white acceleration, or walk; come and go; are missed; and clutter."""

    n_markers: int = 20
    n_frames: int = 200
    noise: float = 1e-3
    acceleration: float = 1.0
    p_detection: float = 0.9
    p_redetection: float | None = None  # after a miss; misses are independent without it
    clutter: float = 2.0  # a frame
    births: float = 0.0  # a frame
    p_disappear: float = 0.0
    walk: float = 0.0  # σ_w, m/√s; then there is no velocity

    @property
    def p_in_the_long_run(self) -> float:
        """Share of the frames in which a marker is seen."""
        again = self.p_redetection or self.p_detection
        return again / (1 - self.p_detection + again)

    def draw(self, seed: int) -> am.Tracks:
        """Draw a clip and who is whom."""
        rng = np.random.default_rng(seed)
        T = self.n_frames
        starts = [0] * self.n_markers
        for t in range(1, T):
            starts += [t] * rng.poisson(self.births)
        frames: list[list[np.ndarray]] = [[] for _ in range(T)]
        labels: list[list[int]] = [[] for _ in range(T)]
        for k, first in enumerate(starts):
            x, v = rng.uniform(0, EDGE, 3), rng.normal(0, 0.3, 3)
            p_seen = self.p_in_the_long_run
            for t in range(first, T):
                if t > first:
                    if rng.random() < self.p_disappear:
                        break
                    if self.walk:
                        x = x + rng.normal(0, self.walk * np.sqrt(STEP), 3)
                    else:
                        a = rng.normal(0, self.acceleration, 3)
                        x, v = x + v * STEP + a * STEP**2 / 2, v + a * STEP
                is_seen = rng.random() < p_seen or 0 < first == t
                p_seen = self.p_detection if is_seen else self.p_redetection or self.p_detection
                if is_seen:
                    frames[t].append(x + rng.normal(0, self.noise, 3))
                    labels[t].append(k)
        for t in range(T):
            for _ in range(rng.poisson(self.clutter)):
                frames[t].append(rng.uniform(0, EDGE, 3))
                labels[t].append(-1)
        detections = am.Detections.from_frames(
            np.arange(T) * STEP, [np.reshape(f, (-1, 3)) for f in frames]
        )
        return am.Tracks(detections=detections, labels=np.concatenate(labels).astype(np.int64))

    def truth(self, volume: float) -> dict[str, float]:
        """Give the true parameters by name, densities in so many m³."""
        return {
            "noise_sigma": self.noise,
            "motion": self.walk or self.acceleration,
            "p_detection": self.p_detection,
            "p_redetection": self.p_redetection or np.nan,
            "clutter_density": self.clutter / volume,
            "birth_density": self.births / volume,
            "p_disappear": self.p_disappear,
        }


WORLDS: dict[str, tuple[World, Literal["closed", "open"]]] = {
    "20 markers": (World(), "closed"),
    "P_d 0.7, 10 false points a frame": (World(p_detection=0.7, clutter=10.0), "closed"),
    "60 markers, lively": (World(n_markers=60, acceleration=10.0, clutter=6.0), "closed"),
    "random walk": (World(walk=0.05), "closed"),
    "misses in runs": (World(p_detection=0.95, p_redetection=0.3), "closed"),
    "come and go": (World(births=0.2, p_disappear=0.01), "open"),
    "come and go, P_d 0.8": (World(births=0.4, p_disappear=0.02, p_detection=0.8), "open"),
    "come and go, in runs": (
        World(births=0.2, p_disappear=0.01, p_detection=0.95, p_redetection=0.3),
        "open",
    ),
}
SHOWN = (
    "noise_sigma", "motion", "p_detection", "p_redetection", "clutter_density", "birth_density",
    "p_disappear",
)  # fmt: skip


def values(model: am.TrackingModel) -> dict[str, float]:
    motion = model.motion
    level = np.nan
    if isinstance(motion, am.RandomWalk):
        level = motion.walk_sigma
    elif isinstance(motion, am.DWNA):
        level = motion.acceleration_sigma
    return {
        "noise_sigma": model.sensor.noise_sigma,
        "motion": level,
        "p_detection": model.sensor.p_detection,
        "p_redetection": model.sensor.p_redetection or np.nan,
        "clutter_density": model.sensor.clutter_density,
        "birth_density": model.population.birth_density,
        "p_disappear": model.population.p_disappear,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for name, (world, population) in WORLDS.items():
        z: dict[str, list[float]] = {key: [] for key in SHOWN}
        off: dict[str, list[float]] = {key: [] for key in SHOWN}
        kinds: list[str] = []
        seconds: list[float] = []
        for seed in range(options.seeds):
            drawn = world.draw(seed)
            start = time.process_time()
            misses = "bursts" if world.p_redetection else "independent"
            found = am.estimate_model(drawn.detections, population=population, misses=misses)
            seconds.append(time.process_time() - start)
            kinds.append(type(found.model.motion).__name__)
            got = values(found.model)
            # Markers leave the cube; densities are of the box around all points.
            truth = world.truth(float(np.prod(np.ptp(drawn.detections.points, axis=0))))
            for key, std in found.stds.items():
                if key in z and np.isfinite(got[key]):
                    z[key].append((got[key] - truth[key]) / std)
                    off[key].append(abs(got[key] / truth[key] - 1))
        usual = max(set(kinds), key=kinds.count)
        row = [name, population, f"{usual} {kinds.count(usual)}/{len(kinds)}"]
        for key in SHOWN:
            rms = float(np.sqrt(np.mean(np.square(z[key])))) if z[key] else np.nan
            row.append(f"{rms:.2f} ({100 * np.median(off[key]):.1g} %)" if z[key] else "–")
        rows.append([*row, f"{np.median(seconds):.1f}"])
        print(*rows[-1], flush=True)
    head = ["scene", "population", "motion chosen", "σ", "σ_a or σ_w", "P_d", "P_r", "λ_f", "λ_b",
            "p_z", "s"]  # fmt: skip
    lines = [f"{options.seeds} seeds; root mean square of z, and median relative error:", ""]
    publish([*lines, *table(head, rows)], options.markdown)


if __name__ == "__main__":
    main()
