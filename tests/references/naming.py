"""Score of an assignment of names by plain loops, as `engine/naming/` defines it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

KINDS = ((0.004, 0.01, False, False), (0.008, 0.05, True, True), (0.03, 0.15, True, True),
         (0.05, 0.40, True, True))  # fmt: skip


def distance_log_odds(d, s, D, W, B, size, weights):
    """Bounded log odds of a distance against a uniform one over 2 m, times its weight."""
    known = not math.isnan(W)
    near = math.exp(-((d / 0.3) ** 2))
    density = 0.0
    for c, (weight, (fixed, share, scales, varies)) in enumerate(zip(weights, KINDS, strict=True)):
        if known:
            weight *= 0.1 if c == 3 else 1.0
        else:
            weight *= 0.15 + 0.85 * near if c < 2 else 1 + 2 * (1 - near)
        v = fixed**2 + (share * D) ** 2 + (B**2 if varies else 0.0)
        v += s**2 / 4 + W**2 / 2 if known else s**2
        y = 1 + (d - (size if scales else 1.0) * D) ** 2 / (4 * v)
        density += weight * 0.375 / math.sqrt(v) / y**2.5
    odds = min(max(math.log(2.0 * density + 1e-9), -4.0), 6.0)
    return odds * (0.25 + 0.75 / (1 + (s**2 + B**2) / 0.012**2))


def height_log_odds(points, quad, tracks, mean, variance, weight, size, spreads):
    """Bounded log odds of the mean height of the first track over the plane of the others."""
    found = []
    for frame in points:
        x, a, b, c = (frame[k] for k in tracks)
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length > 1e-12 and np.isfinite(x).all():
            found.append(float((x - a) @ normal / length))
    if not found:
        return 0.0
    v = np.var(found) / 4 + variance
    y = 1 + (np.mean(found) - size * mean) ** 2 / (4 * v)
    odds = min(max(math.log(0.3 * 0.375 / math.sqrt(v) / y**2.5 + 0.02), -4.0), 3.0)
    widest = max(spreads[i, j] for i in tracks for j in tracks if i != j)
    widest = 1e3 if math.isnan(widest) else widest
    return weight * odds / (1 + (widest / 0.012) ** 2)


def total(given, names):
    """Score of an assignment, from the arguments of the engine's `NameEvidence`."""
    score = 0.0
    for (i, j), d, s in zip(
        given["pairs"], given["pair_distances"], given["pair_spreads"], strict=True
    ):
        a, b = names[i], names[j]
        if a >= 0 and b >= 0 and not math.isnan(given["distances"][a, b]):
            score += distance_log_odds(
                d, s, given["distances"][a, b], given["movements"][a, b],
                given["variations"][a, b], given["size"], given["weights"],
            )  # fmt: skip
    for k, m in enumerate(names):
        score += given["prior"][k, m] - given["none"] if m >= 0 else 0.0
    track = {m: k for k, m in enumerate(names) if m >= 0}
    for quad, (mean, variance, weight) in zip(given["quads"], given["heights"], strict=True):
        if all(m in track for m in quad):
            tracks = [track[m] for m in quad]
            score += height_log_odds(
                given["positions"], quad, tracks, mean, variance, weight, given["size"],
                given["spreads"],
            )  # fmt: skip
    return score


def best_names(given, n_tracks, n_markers):
    """All assignments of names with their scores, the best first; for a few tracks only."""
    ways = [[]]
    for _ in range(n_tracks):
        ways = [[*way, m] for way in ways for m in range(-1, n_markers) if m < 0 or m not in way]
    scored = sorted(((total(given, way), way) for way in ways), key=lambda item: -item[0])
    assert all(a[0] >= b[0] for a, b in pairwise(scored))
    return scored
