"""The clips of `field.py`: scenes and captures, those that are scored and those to tune on.

Who tunes sees other seeds of the same kind of scene, and of captures the other half of the files,
corrupted in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from captures import captures
from identity import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

__all__ = ["Clip", "Kind", "kinds"]

TUNING_SEED = 1000
# Scene, its options, noise in metres. `smooth` keeps its density, so that 50 markers are the place
# to tune for more.
SCENES: dict[str, tuple[str, dict[str, Any], float]] = {
    "cube": ("cube", {}, 0.005),
    "two cubes": ("crossing", {}, 0.005),
    "walk": ("walk", {}, 0.005),
    "dense 50": ("smooth", {"n_markers": 50, "frames": 100}, 0.005),
    "dense 200": ("smooth", {"n_markers": 200, "frames": 40}, 0.005),
    "dense 1000": ("smooth", {"n_markers": 1000, "frames": 20}, 0.005),
    "person": ("person", {}, 3e-4),
}
TUNED_AS = {"dense 200": "dense 50", "dense 1000": "dense 50"}


@dataclass(frozen=True, kw_only=True)
class Clip:
    """A clip by its name, made when it is needed, with its truth."""

    name: str
    make: Callable[[], am.Tracks]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Clips that one setting is to serve.

    Parameters
    ----------
    name : str
        Of the rows.
    tuned_as : str
        The kind whose tuning clips are used.
    scored, tuning : tuple of Clip
        Disjoint.
    """

    name: str
    tuned_as: str
    scored: tuple[Clip, ...]
    tuning: tuple[Clip, ...]


def cut(truth: am.Tracks, n_frames: int) -> am.Tracks:
    """Give the first frames."""
    d = truth.detections
    n_frames = min(n_frames, d.n_frames)
    n = int(d.offsets[n_frames])
    first = am.Detections(
        times=d.times[:n_frames], offsets=d.offsets[: n_frames + 1], points=d.points[:n]
    )
    labels = truth.labels[:n]
    kept, numbered = np.unique(labels[labels >= 0], return_inverse=True)
    labels = labels.copy()
    labels[labels >= 0] = numbered
    names = tuple(truth.names[int(i)] for i in kept) if truth.names else ()
    return am.Tracks(detections=first, labels=labels, names=names)


def _scene(name: str, seed: int, frames: int) -> am.Tracks:
    scene, options, noise = SCENES[name]
    truth = am.simulate.SCENES[scene].make(seed=seed, **options)
    return cut(am.simulate.sense(truth, missing=0.1, clutter=0.1, noise=noise, seed=seed), frames)


def _scene_clips(name: str, seeds: range, frames: int) -> tuple[Clip, ...]:
    return tuple(
        Clip(name=f"{name}, seed {seed}", make=lambda s=seed: _scene(name, s, frames))
        for seed in seeds
    )


def _capture_clip(path: Path, condition: str, frames: int) -> Clip:
    def make() -> am.Tracks:
        return cut(CONDITIONS[condition](am.read(path).tracks), frames)

    return Clip(name=f"{path.name}, {condition}", make=make)


def _small(data: Path, points: int, files: int) -> list[Path]:
    """Give the captures with truth, from the smallest on, up to so many points."""
    sizes: list[tuple[int, Path]] = []
    for path in captures(data) if data.is_dir() else []:
        capture = am.read(path)
        if any(capture.names) and capture.n_points <= points:
            sizes.append((capture.n_points, path))
    return [path for _, path in sorted(sizes)[-files:]]


def kinds(
    data: Path, *, seeds: int, frames: int, tuning_frames: int, points: int, files: int
) -> list[Kind]:
    """Give all kinds; those of captures in two halves, each tuned on the other."""
    found: list[Kind] = []
    for name in SCENES:
        tuned_as = TUNED_AS.get(name, name)
        tuning = _scene_clips(tuned_as, range(TUNING_SEED, TUNING_SEED + 2), tuning_frames)
        scored = _scene_clips(name, range(seeds), frames)
        found.append(Kind(name=name, tuned_as=tuned_as, scored=scored, tuning=tuning))
    paths = _small(data, points, files)
    for condition in CONDITIONS:
        for half in (0, 1):
            kind = Kind(
                name=f"captures, {condition}",
                tuned_as=f"captures, {condition}, half {half}",
                scored=tuple(_capture_clip(p, condition, frames) for p in paths[half::2]),
                tuning=tuple(
                    _capture_clip(p, condition, tuning_frames) for p in paths[1 - half :: 2][:2]
                ),
            )
            if kind.scored and kind.tuning:
                found.append(kind)
    return found
