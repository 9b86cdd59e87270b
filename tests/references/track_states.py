"""States of tracks from the labels so far: each track is filtered alone, by the textbook filter."""

from __future__ import annotations

import math

import numpy as np

from tests.references.filters import kalman


def states_by_hand(detections, labels, model):
    """Return mean (D, n), covariance (n, n), gap and log odds of each track in the last frame.

    The log odds are those of one marker against clutter: birth and detection against a false alarm
    for the first detection; then survival, and a detection against a false alarm or a missed one.
    """
    d = detections
    D, n = d.n_axes, len(model.motion.modes[0].observation)
    sensor, population = model.sensor, model.population
    log_clutter = math.log(sensor.clutter_density)
    out = {}
    for k in np.unique(labels[labels >= 0]):
        own = labels == k
        frames, points = d.frame_of[own], d.points[own]
        means, covariances, _, _, densities = kalman(model, d.times, frames, points)
        x, P = means[-1], covariances[-1]
        for t in range(frames[-1] + 1, d.n_frames):
            dt = d.times[t] - d.times[t - 1]
            F = np.kron(np.eye(D), model.motion.modes[0].transition(dt)[0])
            Q = np.kron(np.eye(D), model.motion.modes[0].process_noise(dt)[0])
            x, P = F @ x, F @ P @ F.T + Q
        odds = math.log(population.birth_density * sensor.p_detection) - log_clutter
        density, is_missed = iter(densities[1:]), False
        for t in range(frames[0] + 1, d.n_frames):
            p_detection = sensor.p_after_miss if is_missed else sensor.p_detection
            is_missed = t not in frames
            odds += math.log(1 - population.p_disappear)
            if is_missed:
                odds += math.log(1 - p_detection)
            else:
                odds += math.log(p_detection) + next(density) - log_clutter
        gap = d.n_frames - 1 - int(frames[-1])
        out[int(k)] = x.reshape(D, n), P[:n, :n], gap, odds
    return out
