"""Measurements of tracks for naming, by NumPy and plain loops, as `engine/naming/` defines them."""

from __future__ import annotations

import math

import numpy as np

MIN_FRAMES, NEIGHBOURS = 5, 8
MAX_DISTANCE, NOISE, MIN_COMMON, MIN_SPREAD, MIN_DECREASE = 0.3, 0.005, 0.7, 0.015, 0.3


def exchanged_stretches(at):
    """Return pairs of columns of positions (F, n, 3), with the stretch in which they changed."""
    distance = np.linalg.norm(at[:, :, None] - at[:, None], axis=3)  # (F, n, n)
    n_common = np.isfinite(distance).sum(axis=0)
    middle = np.full(n_common.shape, np.inf)
    enough = (n_common >= 2 * MIN_FRAMES) & ~np.eye(len(middle), dtype=bool)
    middle[enough] = np.nanmedian(distance[:, enough], axis=0)
    spread = np.zeros(n_common.shape)
    spread[enough] = np.nanstd(distance[:, enough], axis=0)
    found = []
    for a, b in zip(*np.nonzero(np.triu(middle < MAX_DISTANCE)), strict=True):
        far = np.maximum(middle[a], middle[b])
        far[np.minimum(n_common[a], n_common[b]) < MIN_COMMON * n_common[a, b]] = np.inf
        neighbours = np.argsort(far, kind="stable")[:NEIGHBOURS]
        neighbours = neighbours[np.isfinite(far[neighbours])]
        if len(neighbours) < 3 or spread[[a, b]][:, neighbours].max() < MIN_SPREAD:
            continue
        decrease, first, last = _steadiest(distance[:, a, neighbours], distance[:, b, neighbours])
        if decrease > MIN_DECREASE:
            found.append((decrease, int(a), int(b), first, last))
    done = set()
    result = []
    for _, a, b, first, last in sorted(found, reverse=True):
        if not done & {a, b}:
            result.append((a, b, first, last))
            done |= {a, b}
    return result


def _steadiest(x, y):
    """Return the stretch whose exchange makes two series (F, C) steadiest, with the decrease.

    The decrease is that of the log of the spreads, in the mean of both series and all columns.
    """
    both = np.isfinite(x) & np.isfinite(y)
    n = both.sum(axis=0)
    x, y = np.where(both, x, 0.0), np.where(both, y, 0.0)

    first, last = np.triu_indices(len(x) + 1, 1)
    counts = np.concatenate([np.zeros((1, len(n)), dtype=np.int64), np.cumsum(both, axis=0)])
    inside = counts[last] - counts[first]
    is_long = np.minimum(inside, n - inside).min(axis=1) >= MIN_FRAMES
    if not is_long.any():
        return -np.inf, 0, 0
    first, last = first[is_long], last[is_long]

    def within(values):
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        return sums[last] - sums[first]  # of each stretch, and column

    def variance(s, squares):
        mean = s / n
        return np.maximum(squares / n - mean * mean, 0) + NOISE**2

    move, move2 = within(y - x), within(y**2 - x**2)
    sx, sy, sx2, sy2 = x.sum(axis=0), y.sum(axis=0), (x**2).sum(axis=0), (y**2).sum(axis=0)
    before = variance(sx, sx2) * variance(sy, sy2)
    after = variance(sx + move, sx2 + move2) * variance(sy - move, sy2 - move2)
    gain = 0.25 * (np.log(before).mean() - np.log(after).mean(axis=1))
    best = int(np.argmax(gain))
    return float(gain[best]), int(first[best]), int(last[best])


def window_scores(points, rows, holder, tables):
    """Log odds of each marker for tracks in some frames, (rows, M), from (M, R) tables."""
    neighbours, distances, variances, weights = tables
    out = np.zeros((len(rows), len(neighbours)))
    for i, a in enumerate(rows):
        for m in range(len(neighbours)):
            n = 0
            for r, neighbour in enumerate(neighbours[m]):
                other, v = holder[neighbour], variances[m, r]
                found = np.linalg.norm(points[:, a] - points[:, other], axis=1)
                found = found[np.isfinite(found)]
                if other < 0 or other == a or math.isinf(v) or not len(found):
                    continue
                y = 1 + (found.mean() - distances[m, r]) ** 2 / (4 * v)
                odds = math.log(0.375 / (math.sqrt(v * y) * y * y) + 0.05)
                out[i, m] += weights[m, r] * min(odds, 5.0)
                n += 1
                if n == 4 and out[i, m] < -8:
                    out[i, m] = -50
                    break
    return out


def measured_neighbours(made, size, found, is_kept):
    """Steadiest neighbours of each marker: neighbours, distances, variances, weights, (M, R)."""
    before = size * made.distances
    known = np.isfinite(made.movements)
    movement = np.where(known, made.movements, 0.005 + 0.1 * before)
    fixed, share = (0.004, 0.01) if is_kept else (0.008, 0.05)
    error2 = (fixed + share * before) ** 2 + np.nan_to_num(made.variations) ** 2
    is_known = (found.n_frames >= 8) & np.isfinite(found.middle)
    n = np.minimum(found.n_frames, 60)
    pooled2 = (n * found.spread**2 + 8 * movement**2) / (n + 8)
    variance = np.where(is_known, pooled2, movement**2 + error2)
    distance = np.where(is_known, found.middle, before)
    unused = np.eye(len(made), dtype=bool) | ~np.isfinite(distance) | ~np.isfinite(variance)
    cost = np.where(unused, np.inf, np.sqrt(variance) + 0.02 * np.nan_to_num(distance))
    order = np.argsort(cost, axis=1, kind="stable")[:, :14]
    variance = np.take_along_axis(np.where(unused, np.inf, variance), order, axis=1)
    distance = np.take_along_axis(np.where(unused, 0.0, distance), order, axis=1)
    return order, distance, variance + 0.003**2, 0.2 + 0.8 / (1 + variance / 0.015**2)
