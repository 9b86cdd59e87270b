"""Every partition of a few detections into tracks and clutter, with its log posterior."""

from __future__ import annotations

import functools
import itertools

import numpy as np

import asterism as am
from tests.scenes import small_model


def every_track(detections: am.Detections, model: am.TrackingModel):
    """All tracks that the model allows, as tuples of detections, and their scores s(τ)."""
    d, gap = detections, model.population.max_gap
    frame_of = d.frame_of.tolist()
    frames = [range(a, b) for a, b in itertools.pairwise(d.offsets.tolist())]
    paths = []
    for choice in itertools.product(*([-1, *frame] for frame in frames)):
        path = tuple(i for i in choice if i >= 0)
        links = itertools.pairwise(frame_of[i] for i in path)
        if len(path) >= 2 and all(b - a <= gap for a, b in links):
            paths.append(path)
    if not paths:
        return [], np.empty(0)
    # Each has its own copies of its detections, so that one call scores all.
    of = np.concatenate(paths)
    labels = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
    order = np.argsort(d.frame_of[of], kind="stable")
    counts = np.bincount(d.frame_of[of], minlength=d.n_frames)
    copies = am.Detections(
        times=d.times, offsets=np.append(0, np.cumsum(counts)), points=d.points[of[order]]
    )
    scores = am.model.track_scores(am.Tracks(detections=copies, labels=labels[order]), model)
    allowed = np.isfinite(scores)
    return [path for path, ok in zip(paths, allowed, strict=True) if ok], scores[allowed]


def every_partition(detections: am.Detections, model: am.TrackingModel):
    """All partitions, as tuples of tracks, and their log posteriors."""
    paths, scores = every_track(detections, model)
    masks = [sum(1 << i for i in path) for path in paths]
    found = []

    def extend(first: int, used: int, chosen: tuple, total: float) -> None:
        found.append((chosen, total))
        for k in range(first, len(paths)):
            if not used & masks[k]:
                extend(k + 1, used | masks[k], (*chosen, paths[k]), total + scores[k])

    extend(0, 0, (), 0.0)
    return [partition for partition, _ in found], np.array([total for _, total in found])


def tiny_problem(rng: np.random.Generator, n_frames: int, most: int, n_axes: int = 3):
    """A few frames of a few points, near enough to each other for several explanations."""
    times = np.cumsum(rng.uniform(0.08, 0.12, n_frames)).round(6)
    x = rng.normal(0, 0.05, (most, n_axes))
    frames = []
    for _ in range(n_frames):
        x = x + rng.normal(0, 0.03, x.shape)
        frames.append(x[rng.permutation(most)[: rng.integers(0, most + 1)]])
    return am.Detections.from_frames(times, [f.reshape(-1, n_axes) for f in frames])


def tiny_model(rng: np.random.Generator) -> am.TrackingModel:
    """A model under which such points have several explanations that are worth something."""
    p_detection = float(rng.uniform(0.6, 0.95))
    return small_model(
        motion=am.DWNA(acceleration_sigma=2.0, velocity_sigma=0.4),
        noise_sigma=0.01,
        p_detection=p_detection,
        p_redetection=p_detection**2,
        clutter_density=float(rng.uniform(1, 30)),
        birth_density=float(rng.uniform(0.5, 10)),
        p_disappear=float(rng.uniform(0.01, 0.3)),
        max_speed=float(rng.choice([1.0, 4.0])),
        max_gap=int(rng.integers(1, 5)),
        termination=str(rng.choice(["marginal", "last"])),
    )


@functools.cache
def problem_of_size(least, most, seed, n_axes):
    """The first problem from a seed on that has so many partitions."""
    while True:
        rng = np.random.default_rng(seed)
        d, model = tiny_problem(rng, 5, 3, n_axes), tiny_model(rng)
        if d.n_points >= 8 and least <= len(every_partition(d, model)[0]) <= most:
            return d, model
        seed += 1
