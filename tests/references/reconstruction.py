"""Reconstruction the slow way: every set of image points, its likelihood word by word."""

from __future__ import annotations

import itertools

import numpy as np

import asterism as am


def score(rig, model: am.multiview.ImageModel, chosen, gate=4.0) -> float:
    """Log likelihood ratio of image points (one or None of each camera) being one point.

    By the definition: the place is integrated out numerically exactly for a linear image (Laplace).
    """
    sigma, p_detection, clutter = model.of(rig)
    z = np.array([[np.full(2, np.nan) if p is None else p] for p in chosen])
    found = am.multiview.triangulate(z, rig, sigma_px=sigma)
    X, P = found.points[0], found.covariances[0]
    if not np.isfinite(P).all():
        return -np.inf
    r2 = (found.residuals[:, 0] ** 2).sum(axis=1) / sigma**2
    if np.nanmax(r2) > gate**2:
        return -np.inf
    total = np.log(model.density) + 0.5 * np.log(np.linalg.det(2 * np.pi * P))
    for c, camera in enumerate(rig):
        if chosen[c] is not None:
            density = np.exp(-r2[c] / 2) / (2 * np.pi * sigma[c] ** 2)
            total += np.log(p_detection[c] * density / clutter[c])
        elif camera.project(X).visible:
            total += np.log(1 - p_detection[c])
    return float(total)


def every_set(rig, model, pixels, min_views=2, gate=4.0):
    """Give all sets of image points that are likelier than clutter: indices (-1: none), scores."""
    tuples, scores = [], []
    for which in itertools.product(*(range(-1, len(p)) for p in pixels)):
        if sum(i >= 0 for i in which) >= min_views:
            chosen = [p[i] if i >= 0 else None for i, p in zip(which, pixels, strict=True)]
            value = score(rig, model, chosen, gate)
            if value > 0:
                tuples.append(which)
                scores.append(value)
    return np.array(tuples, dtype=np.int64).reshape(-1, len(pixels)), np.array(scores)
