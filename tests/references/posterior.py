"""Score of a track, term by term from the formula."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from asterism.model import TrackingModel


def chance_seen(model: TrackingModel, missed: int) -> float:
    """Probability that a marker is seen that was missed in the last so many frames."""
    sensor = model.sensor
    if missed and sensor.p_redetection is not None:
        return sensor.p_redetection
    return sensor.p_detection


def unseen(model: TrackingModel, r: int) -> float:
    """Probability that a marker that was just seen lives r frames more and is seen in none."""
    alive = 1 - model.population.p_disappear
    return math.prod(alive * (1 - chance_seen(model, k)) for k in range(r))


def chances(model: TrackingModel, frames) -> list[float]:
    """Probability of what happened in each frame from the first detection to the last."""
    was_seen, missed, each = set(np.asarray(frames).tolist()), 0, []
    for t in range(frames[0], frames[-1] + 1):
        p = chance_seen(model, missed)
        each.append(p if t in was_seen else 1 - p)
        missed = 0 if t in was_seen else missed + 1
    return each


def track_score(model: TrackingModel, times, frames, points, log_densities) -> float:
    """s(τ), term by term, with E_r summed over the time of death instead of by recursion."""
    population, sensor = model.population, model.sensor
    n = len(frames)
    if n < 2:
        return -math.inf
    for i in range(1, n):
        dt = times[frames[i]] - times[frames[i - 1]]
        reach = population.max_speed * dt + 6 * sensor.noise_sigma
        if frames[i] - frames[i - 1] > population.max_gap:
            return -math.inf
        if np.linalg.norm(points[i] - points[i - 1]) > reach:
            return -math.inf
    survived = frames[-1] - frames[0]
    r = len(times) - 1 - frames[-1]
    p_z = population.p_disappear
    if population.termination == "last":
        end = p_z if r else 1.0
    else:
        end = sum(unseen(model, k) * p_z for k in range(r)) + unseen(model, r)
    return (
        math.log(population.birth_density)
        - n * math.log(sensor.clutter_density)
        + sum(math.log(p) for p in chances(model, frames))
        + survived * math.log(1 - p_z)
        + math.log(end)
        + sum(log_densities[1:])
    )
