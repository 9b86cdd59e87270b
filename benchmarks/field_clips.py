"""The clips of `field.py`: scenes and captures, those that are scored and those to tune on.

Who tunes sees other seeds of the same kind of scene, and other captures corrupted in the same way:
every third one by name, which none is scored on.
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


def cut(truth: am.Tracks, n_frames: int, *, is_middle: bool = False) -> am.Tracks:
    """Give the first frames, or those in the middle, where a recording is busiest."""
    d = truth.detections
    n_frames = min(n_frames, d.n_frames)
    first = (d.n_frames - n_frames) // 2 if is_middle else 0
    offsets = d.offsets[first : first + n_frames + 1]
    inside = slice(int(offsets[0]), int(offsets[-1]))
    part = am.Detections(
        times=d.times[first : first + n_frames],
        offsets=offsets - offsets[0],
        points=d.points[inside],
    )
    labels = truth.labels[inside]
    kept, numbered = np.unique(labels[labels >= 0], return_inverse=True)
    labels = labels.copy()
    labels[labels >= 0] = numbered
    names = tuple(truth.names[int(i)] for i in kept) if truth.names else ()
    return am.Tracks(detections=part, labels=labels, names=names)


def _scene(name: str, seed: int, frames: int) -> am.Tracks:
    scene, options, noise = SCENES[name]
    truth = am.simulate.SCENES[scene].make(seed=seed, **options)
    return cut(am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=noise, seed=seed), frames)


def _scene_clips(name: str, seeds: range, frames: int) -> tuple[Clip, ...]:
    return tuple(
        Clip(name=f"{name}, seed {seed}", make=lambda s=seed: _scene(name, s, frames))
        for seed in seeds
    )


def _capture_clip(path: Path, condition: str, frames: int) -> Clip:
    def make() -> am.Tracks:
        return cut(CONDITIONS[condition](am.read(path).tracks), frames, is_middle=True)

    return Clip(name=f"{path.name}, {condition}", make=make)


def with_truth(data: Path) -> list[Path]:
    """Give the captures whose points are named."""
    paths = captures(data) if data.is_dir() else []
    return [path for path in paths if any(am.read(path).names)]


def kinds(data: Path, *, seeds: int, frames: int, tuning_frames: int, files: int) -> list[Kind]:
    """Give all kinds: the scenes, and the captures once for each way to corrupt them."""
    found: list[Kind] = []
    for name in SCENES:
        tuned_as = TUNED_AS.get(name, name)
        tuning = _scene_clips(tuned_as, range(TUNING_SEED, TUNING_SEED + 2), tuning_frames)
        scored = _scene_clips(name, range(seeds), frames)
        found.append(Kind(name=name, tuned_as=tuned_as, scored=scored, tuning=tuning))
    paths = with_truth(data)
    to_tune = paths[2::3]
    to_score = [path for path in paths if path not in to_tune][:files]
    for condition in CONDITIONS if to_tune else ():
        name = f"captures, {condition}"
        found.append(
            Kind(
                name=name,
                tuned_as=name,
                scored=tuple(_capture_clip(path, condition, frames) for path in to_score),
                tuning=tuple(_capture_clip(path, condition, tuning_frames) for path in to_tune),
            )
        )
    return found
