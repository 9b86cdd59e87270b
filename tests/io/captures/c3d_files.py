"""Points of a grid, for files."""

from __future__ import annotations

import numpy as np


def grid(n_frames=4, n_points=3):
    """Points in millimetres that all differ, with a fourth word of 0."""
    values = np.arange(n_frames * n_points * 3, dtype=float).reshape(n_frames, n_points, 3) + 100
    return np.concatenate([values, np.zeros((n_frames, n_points, 1))], axis=2)
