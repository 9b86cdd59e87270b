"""A rigid scene, its model, and gaps cut into it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import asterism as am

MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=10, velocity_sigma=2),
    sensor=am.Sensor(noise_sigma=1e-4, p_detection=0.95, clutter_density=0.1),
    population=am.Population(birth_density=0.1, p_disappear=1e-3, max_speed=8, max_gap=10),
)


def occluded_at(truth, *spans):
    """Hide a marker in some frames; give the tracks that are left."""
    positions = truth.positions()
    for k, first, last in spans:
        positions[first : last + 1, k] = np.nan
    return am.Tracks.from_dense(truth.detections.times, positions, truth.names)


def rigid(n_markers=6, frames=300, seed=0, noise=0.0, n_axes=3, times=None):
    """Make a rigid body that tumbles through the room."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / 100 if times is None else times
    shape = rng.uniform(-0.3, 0.3, (n_markers, n_axes))
    middle = np.stack([np.sin(t + i) + 0.3 * np.sin(5 * t) for i in range(n_axes)], axis=1)
    if n_axes == 3:
        turn = Rotation.from_rotvec(np.stack([3 * t, np.sin(4 * t), t], axis=1)).as_matrix()
    else:
        c, s = np.cos(3 * t), np.sin(3 * t)
        turn = np.stack([c, -s, s, c], axis=1).reshape(-1, 2, 2)
    at = np.einsum("tij,kj->tki", turn, shape) + middle[:, None]
    return am.Tracks.from_dense(t, at + rng.normal(scale=noise or 1e-300, size=at.shape))
