"""The tracking model of a large scene, estimated from a spatial crop of its first frames.

`estimate_model` starts from unambiguous links between consecutive frames. Where markers move about
as far as they are apart there are few of these, all of slow markers. Here the sample is also
tracked by the large tracker itself with models of several speeds; the best of them is refined by
expectation maximisation with its tracks. The log posterior of the tracked sample decides between
all models.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, cast

import numpy as np

from asterism.errors import ParameterError
from asterism.large.tracker import LargeTracker
from asterism.model import (
    DWNA,
    Detections,
    Population,
    RandomWalk,
    Sensor,
    TrackingModel,
    Tracks,
    log_posterior,
)
from asterism.tracking import estimate_model
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.motion_fit import FitBounds, fit_one_motion

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

__all__ = ["SAMPLE_FRAMES", "SAMPLE_POINTS", "crop", "estimate_from_start"]

SAMPLE_FRAMES = 30
SAMPLE_POINTS = 1500
"""Frames, and detections of the first of them, from which the model is estimated."""
_SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7)
"""Standard deviations of a coordinate's displacement in a frame that are tried, in spacings."""
_ROUNDS = 4  # of expectation maximisation
_COARSE, _FINE = (0.7, 1.0, 1.4), (0.85, 1.0, 1.2, 1.4)
"""Factors on the fitted acceleration that are tried, because wrong links look like jolts: in each
round, and in the end."""
_MIN_LINKS = 30
_MAX_GAP = 60


def crop(frames: Iterable[tuple[float, NDArray[np.float64]]]) -> Detections:
    """Return the first frames of a scene within a cube about its median.

    Parameters
    ----------
    frames : iterable of (float, ndarray of shape (N, D))
        Times, seconds, and detections, metres. At most `SAMPLE_FRAMES` are taken.

    Returns
    -------
    Detections
        About `SAMPLE_POINTS` detections of the first frame that has any, and those of the frames
        after it in the same cube.

    Examples
    --------
    >>> points = np.random.default_rng(1).random((4000, 3))
    >>> crop([(0.0, points), (1.0, points)])
    Detections(2 frames, 3000 points, 3-D, 0 to 1 s)
    """
    times: list[float] = []
    inside: list[NDArray[np.float64]] = []
    centre, reach = np.zeros(0), np.inf
    for time, points in islice(frames, SAMPLE_FRAMES):
        if not len(centre) and len(points):
            centre = np.median(points, axis=0)
            if len(points) > SAMPLE_POINTS:
                distance = np.abs(points - centre).max(axis=1)
                reach = np.partition(distance, SAMPLE_POINTS - 1)[SAMPLE_POINTS - 1]
        if len(centre):
            points = points[np.abs(points - centre).max(axis=1) <= reach]
        times.append(time)
        inside.append(points)
    return Detections.from_frames(times, inside)


def estimate_from_start(frames: Iterable[tuple[float, NDArray[np.float64]]]) -> TrackingModel:
    """Estimate the model of a large scene from a crop of its first frames.

    Detection probability and clutter are those of the interior of the crop, because markers cross
    its border.

    Parameters
    ----------
    frames : iterable of (float, ndarray of shape (N, D))
        Times, seconds, and detections, metres.

    Returns
    -------
    TrackingModel

    Raises
    ------
    ParameterError
        If there are too few frames or detections, or none can be followed.

    Examples
    --------
    >>> import asterism as am
    >>> round(estimate_from_start(am.simulate.cube(seed=1).detections).sensor.p_detection, 2)
    1.0
    """
    sample = crop(frames)
    if sample.n_frames < 4 or sample.n_points < 4:
        found = f"{sample.n_frames} frames with {sample.n_points} points"
        raise ParameterError("model", "a model, or at least 4 frames to estimate one", found)
    guesses = [(*_tracked(sample, model), model) for model in _guesses(sample)]
    refined = None
    if guesses:
        _, tracks, model = max(guesses, key=lambda one: one[0])
        for _ in range(_ROUNDS):
            better = _refined(tracks, model)
            if better is None:
                break
            tries = [(*_tracked(sample, one), one) for one in _scaled(better, _COARSE)]
            _, tracks, model = max(tries, key=lambda one: one[0])
            refined = model
    if refined is not None:
        refined = max(_scaled(refined, _FINE), key=lambda one: _tracked(sample, one)[0])
    try:
        usual = estimate_model(sample).model
    except ParameterError:
        if refined is None:
            raise
        return refined
    if refined is None:
        return usual
    # Both motions with the same rates, which the border of the crop does not bias.
    sensor = replace(refined.sensor, noise_sigma=usual.sensor.noise_sigma)
    usual = replace(usual, sensor=sensor, population=refined.population)
    return max((refined, usual), key=lambda model: _tracked(sample, model)[0])


def _tracked(sample: Detections, model: TrackingModel) -> tuple[float, Tracks]:
    """Return the log posterior of the tracked sample, and its tracks."""
    tracker = LargeTracker(model=model, n_axes=sample.n_axes)
    state, labels = tracker.init(), [np.zeros(0, np.int64)]
    for time, points in sample:
        state, decided = tracker.step(state, time, points)
        labels += [frame.labels for frame in decided]
    labels += [frame.labels for frame in tracker.finish(state)[1]]
    tracks = Tracks(detections=sample, labels=np.concatenate(labels))
    return log_posterior(tracks, model), tracks


def _guesses(sample: Detections) -> list[TrackingModel]:
    """Return a model for each speed that is tried."""
    spacing = _spacing(sample)
    if not spacing > 0:
        return []
    density = sample.n_points / sample.n_frames / _volume(sample)
    dt = sample.step
    models: list[TrackingModel] = []
    for share in _SPEEDS:
        speed = share * spacing / dt
        models.append(
            TrackingModel(
                motion=DWNA(acceleration_sigma=0.3 * speed / dt, velocity_sigma=speed),
                sensor=Sensor(
                    noise_sigma=0.05 * spacing, p_detection=0.9, clutter_density=0.1 * density
                ),
                population=Population(
                    birth_density=0.01 * density, p_disappear=1e-3, max_speed=5 * speed, max_gap=7
                ),
            )
        )
    return models


def _scaled(model: TrackingModel, factors: tuple[float, ...]) -> list[TrackingModel]:
    """Return the model with weaker and stronger random motion."""
    (own,) = model.motion.modes
    name = "walk_sigma" if isinstance(own, RandomWalk) else "acceleration_sigma"
    level = float(getattr(own, name))
    return [
        replace(model, motion=replace(cast("DWNA", own), **{name: factor * level}))
        for factor in factors
    ]


def _spacing(sample: Detections) -> float:
    """Return the median distance of a detection to the nearest other one of its frame, metres."""
    from scipy.spatial import KDTree

    frames = [points for _, points in sample if len(points) > 1]
    nearest = [KDTree(points).query(points, k=2)[0][:, 1] for points in frames]
    return float(np.median(np.concatenate(nearest))) if nearest else 0.0


def _volume(sample: Detections) -> float:
    extent = np.ptp(sample.points, axis=0)
    return float(np.prod(np.maximum(extent, 1e-6 * max(float(extent.max()), 1e-9))))


def _refined(tracks: Tracks, model: TrackingModel) -> TrackingModel | None:
    """Return the model that fits the tracks best, None if there are too few."""
    d = tracks.detections
    order, _ = tracks.by_track
    is_link = np.diff(tracks.labels[order]) == 0
    n_links = int(is_link.sum())
    if n_links < _MIN_LINKS:
        return None
    frame = d.frame_of[order]
    spans, points = np.diff(frame)[is_link], d.points[order]
    velocities = np.diff(points, axis=0)[is_link] / np.diff(d.times[frame])[is_link, None]
    volume, spacing = _volume(d), _spacing(d)
    (own,) = model.motion.modes
    level = float(getattr(own, "acceleration_sigma", spacing / d.step**2))
    bounds = FitBounds(min_noise=1e-6 * spacing, max_acceleration=0.5 * spacing / d.step**2)
    start = MotionFit(noise=model.sensor.noise_sigma, levels=(level,), stay=1.0)
    fit = fit_one_motion(tracks, model, bounds.clip(start), bounds)
    speed = float(np.sqrt((velocities**2).mean()))
    top = float(np.quantile(np.linalg.norm(velocities, axis=1), 0.9999))
    # Events near the border of the crop are those of markers that cross it.
    margin = np.minimum(2 * top * d.step, 0.2 * np.ptp(d.points, axis=0))
    low, high = d.points.min(axis=0) + margin, d.points.max(axis=0) - margin
    is_inside = ((d.points >= low) & (d.points <= high)).all(axis=1)
    inner = max(float(is_inside.mean()), 1e-3) * volume
    both = (is_inside[order][:-1] & is_inside[order][1:])[is_link]
    n_hits, n_missed = int(both.sum()), int((spans[both] - 1).sum())
    starts = np.flatnonzero(np.diff(tracks.labels[order], prepend=-1) != 0)
    ends = np.append(starts[1:], len(order)) - 1
    last = d.n_frames - 1 - model.population.max_gap
    n_births = int((is_inside[order[starts]] & (frame[starts] > 3)).sum())
    n_deaths = int((is_inside[order[ends]] & (frame[ends] < last)).sum())
    n_clutter = int(((tracks.labels < 0) & is_inside).sum())
    p_missed = (n_missed + 0.5) / (n_hits + n_missed + 1)
    # So long that fewer than one burst of missed detections is longer, and so short that a coasting
    # track is predicted to within the spacing.
    needed = 1 - math.log(2 * n_links) / math.log(p_missed)
    coasted = (3 * (spacing / (fit.levels[0] * d.step**2)) ** 2) ** (1 / 3)
    if fit.kind == "random_walk":
        coasted = (spacing / fit.levels[0]) ** 2 / d.step
    return replace(
        model,
        motion=fit.motion(speed),
        sensor=Sensor(
            noise_sigma=fit.noise,
            p_detection=1 - p_missed,
            clutter_density=(n_clutter + 0.5) / d.n_frames / inner,
        ),
        population=Population(
            birth_density=(n_births + 1) / d.n_frames / inner,
            p_disappear=(n_deaths + 0.5) / (n_links + 1),
            max_speed=2 * top + 4 * fit.noise / d.step,
            max_gap=max(3, round(max(min(coasted, _MAX_GAP), min(needed, _MAX_GAP)))),
        ),
    )
