"""Activities, gaps and speeds of simulated people."""

from __future__ import annotations

import numpy as np
import pytest

ACTIVITIES = ("walk", "run", "jump", "turn")
ACTIVITY = pytest.mark.parametrize("activity", ACTIVITIES)


def gaps(positions, capsule):
    """Distance of markers (T, K, 3) from the skin of a capsule, negative inside."""
    start, end = capsule.ends[:, None, 0], capsule.ends[:, None, 1]
    axis = end - start
    share = ((positions - start) * axis).sum(-1) / np.maximum((axis**2).sum(-1), 1e-12)
    nearest = start + np.clip(share, 0, 1)[..., None] * axis
    return np.linalg.norm(positions - nearest, axis=-1) - capsule.radius


def fastest(truth, rate, order):
    change = np.diff(truth.positions(), n=order, axis=0) * rate**order
    return np.linalg.norm(change, axis=-1).max()
