"""Detections of a corrupted capture by marker."""

from __future__ import annotations

import numpy as np


def rows(tracks, is_true=True):
    """Give the set of (frame, marker, position) of the true or the false points."""
    chosen = (tracks.labels >= 0) == is_true
    d = tracks.detections
    return {
        (int(f), int(k), *p)
        for f, k, p in zip(
            d.frame_of[chosen], tracks.labels[chosen], d.points[chosen].tolist(), strict=True
        )
    }


def detected(tracks):
    return np.isfinite(tracks.positions()).all(axis=2)
