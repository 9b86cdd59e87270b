"""Random groups of tracks and detections."""

from __future__ import annotations

import numpy as np


def random_group(rng, n, m, *, spread=None, ties=False):
    """Weights from sparse to dense; whole tracks and detections may be without any candidate."""
    spread = rng.choice([0.5, 3, 30]) if spread is None else spread
    weights, miss = rng.uniform(-spread, spread, (n, m)), rng.uniform(-spread, spread, n)
    if ties:
        weights, miss = np.round(weights / spread) * spread, np.round(miss / spread) * spread
    weights[rng.random((n, m)) < rng.choice([0, 0.3, 0.6, 0.9])] = -np.inf
    return weights, miss
