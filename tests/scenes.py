"""Small models and captures that many tests share."""

from __future__ import annotations

import os

import numpy as np
from scipy.spatial.transform import Rotation

import asterism as am

SANITIZED = bool(os.environ.get("ASTERISM_SANITIZED"))
"""Whether the engine is the one with the sanitizers, which is ten times slower."""


def sized(usual: int, sanitized: int) -> int:
    """Size of a test: as usual, or cut down for the sanitizers."""
    return sanitized if SANITIZED else usual


def small_model(**changes) -> am.TrackingModel:
    """Markers that move about 0.1 m in a frame of 0.1 s, seen to 5 mm."""
    values = {
        "motion": am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.8),
        "noise_sigma": 0.005,
        "p_detection": 0.9,
        "p_redetection": 0.6,
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
            p_redetection=values["p_redetection"],
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


def crowd(seed: int, n_axes: int = 3, spread: float = 0.08, n_frames: int = 25) -> am.Tracks:
    """Five markers that hardly keep apart, in clutter that lies among them."""
    rng = np.random.default_rng(seed)
    x, v = rng.normal(0, spread, (5, n_axes)), rng.normal(0, 0.1, (5, n_axes))
    frames, labels = [], []
    for _ in range(n_frames):
        x, v = x + 0.1 * v, v + rng.normal(0, 0.1, v.shape) - 0.3 * x
        seen = np.flatnonzero(rng.random(5) < 0.9)
        false = rng.normal(0, 2 * spread, (rng.poisson(1.0), n_axes))
        points = np.concatenate([x[seen] + rng.normal(0, 0.01, (len(seen), n_axes)), false])
        order = rng.permutation(len(points))
        frames.append(points[order])
        labels.append(np.concatenate([seen, np.full(len(false), -1)])[order])
    d = am.Detections.from_frames(0.1 * np.arange(n_frames), frames)
    return am.Tracks(detections=d, labels=np.concatenate(labels).astype(np.int64))


def calibration_in_crowds(method):
    """Hold the confidence of links against what they are, over forty crowds and their own model."""
    right, sure = [], []
    for seed in range(40):
        truth = crowd(100 + seed, spread=0.1)
        model = small_model(
            motion=am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
            clutter_density=1.0 / (4 * np.pi / 3 * 0.3**3), birth_density=1e-2,
            p_disappear=1e-4, max_gap=6, max_speed=1.5,
        )  # fmt: skip
        tracks = am.track(truth.detections, method, model=model)
        order, _ = tracks.by_track
        is_link = np.diff(tracks.labels[order]) == 0
        a, b = order[:-1][is_link], order[1:][is_link]
        right.append(truth.labels[a] == truth.labels[b])
        sure.append(tracks.confidence[b])
    return am.metrics.calibration_curve(np.concatenate(sure), np.concatenate(right))


def stitched(detections, method=None, *, model=None, seed=None, **options):
    """Return the stitching of a method's tracklets, with all that it knows of them."""
    model = am.tracking.tracklet_model(model or am.estimate_model(detections).model)
    tracklets = am.track(detections, method or am.SMP(window=3), model=model, seed=seed)
    return am.stitch(tracklets, model, **options)


def moving(shape, n_frames=120, seed=0, noise=0.0):
    """A rigid body that turns and wanders."""
    rng = np.random.default_rng(seed)
    t = np.arange(n_frames) / 100
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(scale=0.03, size=(n_frames, 3)), axis=0))
    places = np.stack([turns.apply(x) for x in shape], axis=1)
    places += np.cumsum(rng.normal(scale=0.005, size=(n_frames, 1, 3)), axis=0)
    return t, places + rng.normal(scale=noise, size=places.shape)


def exchanged(tracks, pair, frames):
    """Exchange two tracks in some frames."""
    labels = tracks.labels.copy()
    inside = np.isin(tracks.detections.frame_of, frames)
    is_one, is_other = (inside & (tracks.labels == k) for k in pair)
    labels[is_one], labels[is_other] = pair[1], pair[0]
    return am.Tracks(detections=tracks.detections, labels=labels)


def steady_and_loose(seed, until=300):
    """A rod of five markers, one that keeps its distances to them, and one that swings.

    The last two have the same distances in the median, and are occluded together twice, at
    frame 100 and at `until`.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(2 * until) * 0.01
    swing = 0.03 * np.sin(2 * np.pi * 1.3 * t + rng.uniform(0, 6))
    body = np.stack([0.3 * np.sin(t), 0.2 * t, 0.1 * np.cos(2 * t)], axis=1)
    rod = [body + np.array([0, 0, 0.1 * k]) for k in range(5)]
    steady = body + np.array([0.1, 0, 0.2])
    loose = body + np.stack([-0.1 - swing, np.zeros(len(t)), np.full(len(t), 0.2)], axis=1)
    positions = np.stack([*rod, steady, loose], axis=1)
    positions += rng.normal(0, 1e-3, positions.shape)
    positions[95:115, 5:] = positions[until - 5 : until + 15, 5:] = np.nan
    return am.Tracks.from_dense(t, positions, tuple("ABCDESL"))


def two_that_circle(seed, radius=0.1):
    """A rod of five markers, and two that circle around it with the same distances to it."""
    rng = np.random.default_rng(seed)
    angle = 3 * np.arange(400) * 0.01 + rng.uniform(0, 6)
    circle = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    middle = np.array([0, 0, 0.2])
    rod = [np.tile(0.5 * k * middle, (400, 1)) for k in range(5)]
    positions = np.stack([*rod, middle + circle, middle - circle], axis=1)
    positions += rng.normal(0, 1e-3, positions.shape)
    return am.Tracks.from_dense(np.arange(400) * 0.01, positions, tuple("ABCDEFG"))
