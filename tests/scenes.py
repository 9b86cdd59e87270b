"""Small models and captures that many tests share."""

from __future__ import annotations

import numpy as np

import asterism as am


def small_model(**changes) -> am.TrackingModel:
    """Markers that move about 0.1 m in a frame of 0.1 s, seen to 5 mm."""
    values = {
        "motion": am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.8),
        "noise_sigma": 0.005,
        "p_detection": 0.9,
        "clutter_density": 0.5,
        "birth_density": 0.05,
        "p_disappear": 0.01,
        "max_speed": 4.0,
        "max_gap": 4,
        "termination": "marginal",
        **changes,
    }
    return am.TrackingModel(
        motion=values["motion"],
        sensor=am.Sensor(
            noise_sigma=values["noise_sigma"],
            p_detection=values["p_detection"],
            clutter_density=values["clutter_density"],
        ),
        population=am.Population(
            birth_density=values["birth_density"],
            p_disappear=values["p_disappear"],
            max_speed=values["max_speed"],
            max_gap=values["max_gap"],
            termination=values["termination"],
        ),
    )


def interacting() -> am.InteractingMotions:
    return am.InteractingMotions(
        models=tuple(am.DWNA(acceleration_sigma=a, velocity_sigma=0.8) for a in (0.3, 3.0, 30.0)),
        transitions=np.array([[0.9, 0.08, 0.02], [0.1, 0.85, 0.05], [0.2, 0.3, 0.5]]),
    )


def wanderers(
    rng: np.random.Generator,
    *,
    n_markers: int = 6,
    n_frames: int = 40,
    n_axes: int = 3,
    missing: float = 0.1,
    clutter: float = 0.8,
    irregular: bool = False,
) -> am.Tracks:
    """Markers that follow `small_model`, with misses and clutter, shuffled; and their truth."""
    steps = np.round(rng.uniform(0.06, 0.14, n_frames), 6) if irregular else np.full(n_frames, 0.1)
    times = np.round(np.cumsum(steps), 6)
    x = rng.uniform(-1, 1, (n_markers, n_axes))
    v = rng.normal(0, 0.5, (n_markers, n_axes))
    frames, labels = [], []
    for dt in steps:
        a = rng.normal(0, 1.5, x.shape)
        x, v = x + v * dt + a * dt**2 / 2, v + a * dt
        v -= 0.5 * x * dt  # a spring that keeps them in sight
        seen = np.flatnonzero(rng.random(n_markers) >= missing)
        false = rng.uniform(-1.5, 1.5, (rng.poisson(clutter), n_axes))
        points = np.concatenate([x[seen] + rng.normal(0, 0.005, (len(seen), n_axes)), false])
        names = np.concatenate([seen, np.full(len(false), -1)])
        order = rng.permutation(len(points))
        frames.append(points[order])
        labels.append(names[order])
    detections = am.Detections.from_frames(times, frames)
    return am.Tracks(detections=detections, labels=np.concatenate(labels).astype(np.int64))
