"""Reference implementation of joint probabilistic data association: sums over all events.

Beside the life of a track (frame_by_frame.OneTrack) it shares nothing with the engine but the
definitions.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from tests.references.frame_by_frame import OneTrack, near

if TYPE_CHECKING:
    import asterism as am


def marginals_of(weights: np.ndarray, missed: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """β (n, m + 1) with the miss last, and the best event: by recursion over the tracks."""
    n, m = weights.shape

    def total(rows: tuple[int, ...]):
        """The weight of all that these tracks may do without the detections in a set."""

        @cache
        def rest(used: int, k: int = 0) -> float:
            if k == len(rows):
                return 1.0
            i = rows[k]
            return missed[i] * rest(used, k + 1) + sum(
                weights[i, j] * rest(used | 1 << j, k + 1)
                for j in range(m)
                if weights[i, j] > 0 and not used >> j & 1
            )

        return rest

    everything = total(tuple(range(n)))(0)
    beta = np.zeros((n, m + 1))
    for i in range(n):
        others = total(tuple(k for k in range(n) if k != i))
        for j in range(m):
            if weights[i, j] > 0:
                beta[i, j] = weights[i, j] * others(1 << j) / everything
        beta[i, m] = missed[i] * others(0) / everything

    @cache
    def best(i: int, used: int) -> tuple[float, tuple[int, ...]]:
        if i == n:
            return 0.0, ()
        options = [(math.log(missed[i]), -1, used)]
        options += [
            (math.log(weights[i, j]), j, used | 1 << j)
            for j in range(m)
            if weights[i, j] > 0 and not used >> j & 1
        ]
        found = []
        for own, j, after in options:
            score, choice = best(i + 1, after)
            found.append((own + score, (j, *choice)))
        return max(found)

    return beta, best(0, 0)[1]


def best_permutations(weights: np.ndarray, missed: np.ndarray) -> np.ndarray:
    """Marginals over the heaviest event of every set of tracks with every set of detections."""
    # What may follow depends on the detections used alone: of each kind the heaviest goes on.
    kept: dict[tuple, tuple[float, tuple[int, ...]]] = {((), 0): (1.0, ())}
    for row, none in zip(weights.tolist(), missed.tolist(), strict=True):
        after: dict[tuple, tuple[float, tuple[int, ...]]] = {}
        for (seen, used), (weight, event) in kept.items():
            options = [((*seen, False), used, weight * none, -1)]
            options += [
                ((*seen, True), used | 1 << j, weight * w, j)
                for j, w in enumerate(row)
                if w > 0 and not used >> j & 1
            ]
            for *kind, heavy, j in options:
                key = tuple(kind)
                after[key] = max(after.get(key, (0.0, ())), (heavy, (*event, j)))
        kept = after
    beta = np.zeros((len(weights), weights.shape[1] + 1))
    for weight, event in kept.values():
        beta[np.arange(len(event)), event] += weight
    return beta / sum(weight for weight, _ in kept.values())


def components(weights: np.ndarray) -> list[list[int]]:
    """Tracks that share detections, directly or through others."""
    groups: list[tuple[set[int], set[int]]] = []
    for i in range(len(weights)):
        rows, columns = {i}, set(np.flatnonzero(weights[i] > 0))
        for group in [g for g in groups if g[1] & columns]:
            groups.remove(group)
            rows |= group[0]
            columns |= group[1]
        groups.append((rows, columns))
    return [sorted(rows) for rows, _ in groups]


class SoftTrack(OneTrack):
    """A track with a probability to exist."""

    missed = 0.0  # probability that it was missed in the last frame, if it exists

    def sure(self, method, confirm: float) -> float:
        """Log odds of its existence as far as sharing goes."""
        is_sure = method.sure_until_gap and self.id >= 0
        return max(self.score, confirm) if is_sure else self.score

    def mix(self, points: np.ndarray, weights: np.ndarray, missed: float) -> None:
        """Moment-matched update; weights and missed sum to 1."""
        D = len(self.x[0])
        each = [self.densities(y) for y in points]
        w = np.zeros(len(self.modes))
        for b in range(len(self.modes)):
            K = self.P[b] @ self.h / self.S[b]
            parts = [(missed * self.w[b], self.x[b], self.P[b])]
            for y, weight, densities in zip(points, weights, each, strict=True):
                x = self.x[b] + np.outer(y - self.x[b] @ self.h, K)
                P = self.P[b] - np.outer(K, K) * self.S[b]
                parts.append((weight * densities[b] / densities.sum(), x, P))
            w[b] = sum(part[0] for part in parts)
            mean = sum(p * x for p, x, _ in parts) / w[b]
            self.P[b] = sum(p * (P + (x - mean).T @ (x - mean) / D) for p, x, P in parts) / w[b]
            self.x[b] = mean
        self.w = w


def sigmoid(x: float) -> float:
    return 1 / (1 + math.exp(-x))


def jpda_by_hand(detections: am.Detections, method: am.JPDA, model: am.TrackingModel):
    """Labels and confidence of every detection, by the slow tracker."""
    s, p = model.sensor, model.population
    gate = chi2.isf(method.gate.probability, detections.n_axes)
    P_d, p_z = s.p_detection, p.p_disappear
    density = s.clutter_density + P_d * p.birth_density
    life = method.lifecycle
    confirm = math.log(life.confirm_probability / (1 - life.confirm_probability))
    labels = np.full(detections.n_points, -1)
    confidence = np.zeros(detections.n_points)
    tracks: list[SoftTrack] = []
    next_id = 0
    for t in range(detections.n_frames):
        now, points = detections.times[t], detections.frame(t)
        first = int(detections.offsets[t])
        n, m = len(tracks), len(points)
        weights, missed, p_seen = np.zeros((n, m)), np.ones(n), np.ones(n)
        for i, track in enumerate(tracks):
            r = (1 - p_z) * sigmoid(track.score)
            track.score = math.log(r) - math.log(1 - r)
            r = sigmoid(track.sure(method, confirm))
            p_seen[i] = (1 - track.missed) * P_d + track.missed * s.p_after_miss
            missed[i] = 1 - r * p_seen[i]
            track.predict(round(now - detections.times[t - 1], 9))
            reach = p.max_speed * (now - track.last_time) + 6 * s.noise_sigma
            own = near(track, points, reach, gate)
            weights[i, own] = r * p_seen[i] * track.densities(points[own]).sum(axis=1) / density
        confirmed = np.array([track.id >= 0 for track in tracks], dtype=bool)
        free, taken = np.ones(m), np.zeros(m, dtype=bool)
        beta, match = np.zeros((n, m + 1)), np.full(n, -1)
        beta[:, m] = 1
        for own in (confirmed, ~confirmed):
            open_to = np.where(own[:, None] & ~taken, weights * free, 0)
            open_to[open_to <= math.exp(-20.7) * missed[:, None]] = 0
            for rows in components(open_to):
                rows = [i for i in rows if own[i]]
                if not rows:
                    continue
                some, none = open_to[rows], missed[rows]
                found, best = marginals_of(some, none)
                match[rows] = best
                is_guarded = method.guard and len(rows) > 1
                moved = best_permutations(some, none) if is_guarded else found
                if not confirmed[rows[0]]:
                    # The best event; each as sure as it is if the others have their part of it.
                    for k in range(len(rows)):
                        rest = some[k] * ~np.isin(np.arange(m), np.delete(best, k))
                        found[k] = np.append(rest, none[k]) / (rest.sum() + none[k])
                    moved = np.zeros_like(found)
                    moved[np.arange(len(rows)), best] = 1
                beta[rows] = found
                for i, share in zip(rows, moved, strict=True):
                    r = sigmoid(tracks[i].sure(method, confirm))
                    share[m] *= r * (1 - p_seen[i]) / (1 - r * p_seen[i])
                    share = share / share.sum()
                    some_j = np.flatnonzero(share[:m])
                    if len(some_j):
                        tracks[i].mix(points[some_j], share[some_j], share[m])
            free = np.maximum(1 - beta[:, :m].sum(axis=0), 0)
            taken[match[match >= 0]] = True
        born = P_d * p.birth_density / density
        confidence[first : first + m] = free * (1 - born)
        for i, track in enumerate(tracks):
            as_if = track.sure(method, confirm)
            r = sigmoid(as_if)
            occluded = beta[i, m] * r * (1 - p_seen[i]) / (1 - r * p_seen[i])
            after = 1 - beta[i, m] + occluded
            gone = beta[i, m] * (1 - r) / (1 - r * p_seen[i])
            track.missed = occluded / after
            track.score += min(math.log(after) - math.log(max(gone, 1e-300)) - as_if, 700)
            j = match[i]
            if j < 0:
                track.gap += 1
                if track.id >= 0 and track.sure(method, confirm) < -confirm:
                    track.gap = p.max_gap
                continue
            track.gap, track.last, track.last_time = 0, points[j], now
            given = 1.0 if track.id >= 0 else sigmoid(track.score)
            track.pending.append((first + int(j), min(beta[i, j] / given, 1.0)))
            if track.id < 0 and track.score >= confirm:
                track.id, next_id = next_id, next_id + 1
            if track.id >= 0:
                for detection, sure in track.pending:
                    labels[detection], confidence[detection] = track.id, sure
                track.pending = []
        for track in tracks:
            track.best = max(track.best, track.score)
        tracks = [
            track
            for track in tracks
            if track.gap < p.max_gap
            and (track.id >= 0 or track.best - track.score <= math.log(life.delete_odds))
        ]
        for j, y in enumerate(points):
            if taken[j] or free[j] <= 0:
                continue
            track = SoftTrack(model, now, y, first + j)
            r = free[j] * born
            track.score = track.best = math.log(r) - math.log(1 - r)
            track.pending = [(first + j, 1.0)]
            tracks.append(track)
    return labels, confidence
