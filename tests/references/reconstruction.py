"""Reconstruction the slow way: every set of image points, its likelihood word by word."""

from __future__ import annotations

import itertools

import numpy as np

import asterism as am


def score(rig, model: am.multiview.ImageModel, chosen, gate=4.0) -> float:
    """Log likelihood ratio of image points (one or None of each camera) being one point.

    By the definition: the place is integrated out numerically exactly for a linear image (Laplace).
    """
    return scores(rig, model, [chosen], gate)[0]


def scores(rig, model: am.multiview.ImageModel, sets, gate=4.0) -> list[float]:
    """Return the scores of several sets, all triangulated in one call."""
    sigma = model.of(rig)[0]
    nothing = np.full(2, np.nan)
    z = np.array([[nothing if p is None else p for p in view] for view in zip(*sets, strict=True)])
    found = am.multiview.triangulate(z, rig, sigma_px=sigma)
    return [
        score_of_point(rig, model, chosen, X, P, residuals, gate)
        for chosen, X, P, residuals in zip(
            sets, found.points, found.covariances, found.residuals.swapaxes(0, 1), strict=True
        )
    ]


def score_of_point(rig, model, chosen, X, P, residuals, gate) -> float:
    sigma, p_detection, clutter = model.of(rig)
    if not np.isfinite(P).all():
        return -np.inf
    r2 = (residuals**2).sum(axis=1) / sigma**2
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
    tuples = [
        which
        for which in itertools.product(*(range(-1, len(p)) for p in pixels))
        if sum(i >= 0 for i in which) >= min_views
    ]
    sets = [
        [p[i] if i >= 0 else None for i, p in zip(which, pixels, strict=True)] for which in tuples
    ]
    values = np.array(scores(rig, model, sets, gate) if sets else [])
    is_likely = values > 0
    found = np.array(tuples, dtype=np.int64).reshape(-1, len(pixels))
    return found[is_likely], values[is_likely]
