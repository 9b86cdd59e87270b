"""Stretches in which two tracks have each other's marker, computed plainly.

Positions are arrays of shape (frames, tracks, D), NaN where a track has no detection. The motion is
a function of two tracks and a frame, so that this is the evidence of the distances alone. By
motion, `exchanges` has the ratios of the exchanges that are possible, by pair and frame.
"""

from __future__ import annotations

import numpy as np

NEAR, REFERENCES, CANDIDATES, CONTRAST, DIVERGENCE, BOTH = 0.3, 8, 16, 2.0, 1.0, 0.25
USUAL, SAMPLED, TOGETHER, KNOWN, MIN_USUAL, ROUNDS = 150, 600, 20, 10, 5, 5
BEND, BOUND, WEIGHT, CHANGE, MIN_GAIN, MIN_MOTION, MOVED = 0.02, 5.0, 1 / 40, 4.0, 6.0, -30.0, 10
SHORTEST = 4


def upper_median(values):
    return np.sort(values)[len(values) // 2]


def median_and_spread(values):
    middle = upper_median(values)
    return middle, 1.4826 * upper_median(np.abs(values - middle))


def usual_distances(positions):
    T, K, _ = positions.shape
    n = min(T, USUAL)
    chosen = positions[np.arange(n) * T // n]
    usual = np.full((K, K), np.inf)
    for a in range(K):
        for b in range(K):
            distance = np.linalg.norm(chosen[:, a] - chosen[:, b], axis=1)
            distance = distance[np.isfinite(distance)]
            if a != b and len(distance) >= MIN_USUAL:
                usual[a, b] = upper_median(distance)
    return usual


def sampled(rows):
    n = min(len(rows), SAMPLED)
    return rows[np.arange(n) * len(rows) // n]


def decoded(evidence, changes):
    """The most probable states by trying, for each frame, both states before it."""
    score, paths = [0.0, 0.0], [[], []]
    for e, change in zip(evidence, changes, strict=True):
        best = [max((0, 1), key=lambda s, to=to: score[s] + change * (s != to) + 1e-12 * (s == to))
                for to in (0, 1)]  # fmt: skip
        paths = [[*paths[best[to]], to] for to in (0, 1)]
        score = [score[best[to]] + change * (best[to] != to) + e * to for to in (0, 1)]
    return np.array(paths[int(score[1] > score[0])])


def log_ratio(distance, middle, variance, against, its_variance):
    x, y = (distance - middle) ** 2 / variance, (distance - against) ** 2 / its_variance
    ratio = 2.5 * np.log((4 + y) / (4 + x)) + 0.5 * np.log(its_variance / variance)
    return np.nan_to_num(np.clip(ratio, -BOUND, BOUND))


def stretches(positions, noise, motion, by_spreads=False, exchanges=None):
    """Return (a, b, first frame, end, log odds) of all pairs; `motion(a, b, frame)` is theirs."""
    floor2 = 2 * max(noise, 2e-3) ** 2
    usual, by_motion = usual_distances(positions), exchanges is not None
    is_seen = np.isfinite(positions[..., 0])
    found = []
    for a, b in zip(*np.nonzero(np.triu(usual < NEAR)), strict=True):
        far = [
            (max(usual[a, r], usual[b, r]), r)
            for r in range(positions.shape[1])
            if r not in (a, b) and is_seen[:, r].sum() > 0.5 * len(positions)
        ]
        candidates = [r for f, r in sorted(far) if np.isfinite(f)][:CANDIDATES]
        frames = np.flatnonzero(is_seen[:, a] | is_seen[:, b])
        together = np.flatnonzero((is_seen[:, a] & is_seen[:, b])[frames])
        if len(candidates) <= 2 or len(together) < TOGETHER:
            continue
        of_a = np.linalg.norm(
            positions[frames][:, candidates] - positions[frames, a][:, None], axis=2
        )
        of_b = np.linalg.norm(
            positions[frames][:, candidates] - positions[frames, b][:, None], axis=2
        )
        some = sampled(together)
        contrasts = []
        for r in range(len(candidates)):
            x, y = of_a[some, r], of_b[some, r]
            known = np.isfinite(x)
            if known.sum() < max(KNOWN, len(some) // 2):
                continue
            difference, spread = median_and_spread(np.abs(x - y)[known])
            _, spread_of_sum = median_and_spread((x + y)[known])
            deviation = np.sqrt(
                spread**2 + spread_of_sum**2 / 4 + floor2 + (BEND * difference) ** 2
            )
            if difference > CONTRAST * deviation:
                contrasts.append((-difference / deviation, candidates[r], r, deviation))
        contrasts = sorted(contrasts)[:REFERENCES]
        columns = [r for _, _, r, _ in contrasts]
        by_middles = len(contrasts) >= 2
        state = np.zeros(len(frames), dtype=int)
        if by_middles:
            sides = _sides(of_a, of_b, together, some, contrasts)
            if not sides.any() or sides.all():
                continue
            state[together] = sides
        elif by_spreads or by_motion:
            columns = list(range(len(candidates)))
        else:
            continue
        changes = np.full(len(frames), -CHANGE)
        if by_motion:
            of_pair = exchanges.get((a, b), {})
            fits = np.array([max(of_pair.get(t, 0.0), 0.0) for t in frames])
            for u, fit in enumerate(fits):
                near = fits[max(u - SHORTEST + 1, 0) : u + SHORTEST]
                changes[u] += fit if fit == near.max() else 0.0
        evidence = None
        for _ in range(2 if by_middles else ROUNDS):
            some = sampled(np.arange(len(frames)))
            known = []
            for r in columns:
                own = np.where(state == 0, of_a[:, r], of_b[:, r])[some]
                others = np.where(state == 0, of_b[:, r], of_a[:, r])[some]
                own, others = own[np.isfinite(own)], others[np.isfinite(others)]
                if min(len(own), len(others)) < KNOWN:
                    continue
                (m, s), (n, t) = median_and_spread(own), median_and_spread(others)
                v, w = s**2 + floor2 + (BEND * m) ** 2, t**2 + floor2 + (BEND * n) ** 2
                if by_middles:
                    v = w = max(v, w)
                divergence = 0.5 * ((v + (m - n) ** 2) / w + (w + (m - n) ** 2) / v) - 1
                if divergence > (CONTRAST**2 if by_middles else DIVERGENCE):
                    known.append((-divergence, candidates[r], r, m, v, n, w))
            known = sorted(known)[:REFERENCES]
            if len(known) < 2 and not by_motion:
                evidence = None
                break
            has_both = np.isin(np.arange(len(frames)), together)
            evidence = np.zeros(len(frames))
            for _, _, r, m, v, n, w in known:
                v, w = (np.where(has_both, x, max(v, w)) for x in (v, w))
                evidence += WEIGHT * log_ratio(of_a[:, r], n, w, m, v)
                evidence += WEIGHT * log_ratio(of_b[:, r], m, v, n, w)
            state = decoded(evidence, changes)
            if 2 * state.sum() > len(state):
                state, evidence = 1 - state, -evidence
        if evidence is None:
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[0], state, [0]])))
        for first, end in edges.reshape(-1, 2):
            if not by_middles and has_both[first:end].mean() < BOTH:
                continue
            best = (-np.inf, 0, 0)
            for i, before in _edges(motion, a, b, frames, first):
                for j, after in _edges(motion, a, b, frames, end):
                    gain = evidence[i:j].sum() + before + after
                    if j > i and gain > best[0] + 1e-9:
                        best = (gain, i, j)
            gain, i, j = best
            if gain > MIN_GAIN and (not by_motion or j - i >= SHORTEST):
                stop = frames[j] if j < len(frames) else frames[-1] + 1
                found.append((int(a), int(b), int(frames[i]), int(stop), gain))
    return found


def _sides(of_a, of_b, together, some, contrasts):
    """Whether each frame with both tracks is on the rarer side of the differences."""
    columns = [r for _, _, r, _ in contrasts]
    scaled = (of_a - of_b)[together][:, columns] / [deviation for *_, deviation in contrasts]
    scaled = np.nan_to_num(np.clip(scaled, -10, 10))
    rows = np.searchsorted(together, some)
    _, vectors = np.linalg.eigh(scaled[rows].T @ scaled[rows])
    side = scaled @ vectors[:, -1]
    # The sign of the vector is that of its part along the largest moment.
    largest = int(np.argmax((scaled[rows] ** 2).sum(axis=0)))
    is_negative = side * np.sign(vectors[largest, -1]) <= 0
    return ~is_negative if 2 * is_negative.sum() > len(together) else is_negative


def _edges(motion, a, b, frames, at):
    if at in (0, len(frames)):
        return [(at, 0.0)]
    near = range(max(at - MOVED, 1), min(at + MOVED, len(frames) - 1) + 1)
    ratios = [(u, motion(a, b, int(frames[u]))) for u in near]
    return [(u, ratio) for u, ratio in ratios if ratio > MIN_MOTION]
