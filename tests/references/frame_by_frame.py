"""Reference implementation of a frame-by-frame tracker: lists, dictionaries, SciPy.

It shares nothing with the engine but the definitions: what a gain is, when a track is confirmed.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

import asterism as am
from tests.references.posterior import chance_seen


@cache
def start_of(model: am.TrackingModel, n_axes: int):
    """Stationary weights of the motions and the covariance of a first state."""
    T = np.asarray(model.motion.mode_transitions)
    M = len(T)
    total = np.vstack([T.T - np.eye(M), np.ones(M)])
    return np.linalg.lstsq(total, np.eye(M + 1)[M], rcond=None)[0], model.initial_covariance(n_axes)


@cache
def step_of(modes: tuple[am.model.Motion, ...], dt: float):
    """F and Q of each motion over a time; asked for again and again."""
    F = np.stack([mode.transition(dt)[0] for mode in modes])
    Q = np.stack([mode.process_noise(dt)[0] for mode in modes])
    return F, F.swapaxes(1, 2), Q


class OneTrack:
    """The life of a track: each motion has a weight w, a state x (axis, order), a covariance P."""

    def __init__(self, model: am.TrackingModel, time: float, point, detection: int) -> None:
        s, p = model.sensor, model.population
        self.modes = tuple(model.motion.modes)
        self.T = np.asarray(model.motion.mode_transitions)
        M = len(self.modes)
        self.w, P = start_of(model, len(point))
        self.h, self.r = self.modes[0].observation, s.noise_sigma**2
        self.x = np.stack([np.outer(point, self.h / (self.h @ self.h))] * M)
        self.P = np.stack([P] * M)
        self.score = math.log(p.birth_density * s.p_detection / s.clutter_density)
        self.best = self.score
        self.id, self.gap, self.last, self.last_time = -1, 0, np.array(point), time
        self.pending = [detection]

    def predict(self, dt: float) -> None:
        M, D, n = self.x.shape
        prior = self.w @ self.T
        share = (self.w[:, None] * self.T / prior).T  # of mode b, what comes of mode a
        mean = (share @ self.x.reshape(M, -1)).reshape(M, D, n)
        off = self.x - mean[:, None]
        spread = self.P + off.swapaxes(-1, -2) @ off / D
        P = (share[:, None] @ spread.reshape(M, M, -1)).reshape(M, n, n)
        F, F_T, Q = step_of(self.modes, dt)
        self.x, self.P, self.w = mean @ F_T, F @ P @ F_T + Q, prior
        Ph = self.P @ self.h
        self.S = Ph @ self.h + self.r
        self.at, self.K = self.x @ self.h, Ph / self.S[:, None]

    def odds(self, gain: float) -> float:
        return gain if self.id >= 0 else np.logaddexp(0, self.score + gain)

    def squares_of(self, points) -> np.ndarray:
        """Normalised innovation squared of a point, or of each, by each motion."""
        return ((points[..., None, :] - self.at) ** 2).sum(axis=-1) / self.S

    def densities(self, points) -> np.ndarray:
        likelihood = np.exp(-0.5 * self.squares_of(points))
        return likelihood * (self.w / (2 * np.pi * self.S) ** (points.shape[-1] / 2))

    def within(self, points, gate: float) -> np.ndarray:
        return (self.squares_of(points) <= gate).any(axis=-1)

    def distance(self, y) -> float:
        return float(self.distances(y[None])[0])

    def distances(self, points) -> np.ndarray:
        return ((points - self.w @ self.at) ** 2).sum(axis=1)

    def update(self, y) -> None:
        each = self.densities(y)
        self.x = self.x + (y - self.at)[:, :, None] * self.K[:, None]
        self.P = self.P - self.K[:, :, None] * self.K[:, None] * self.S[:, None, None]
        self.w = each / each.sum()


def near(track: OneTrack, points, reach: float, gate: float) -> list[int]:
    """Points that a track can reach and that its gate holds."""
    reached = np.linalg.norm(points - track.last, axis=1) <= reach
    return np.flatnonzero(reached & track.within(points, gate)).tolist()


def track_by_hand(detections: am.Detections, method, model: am.TrackingModel) -> np.ndarray:
    """Labels of every detection, by the slow tracker."""
    s, p = model.sensor, model.population
    gate = chi2.isf(method.gate.probability, detections.n_axes)
    survive = math.log1p(-p.p_disappear)

    def hit(gap: int) -> float:
        return survive + math.log(chance_seen(model, gap) / s.clutter_density)

    def miss(gap: int) -> float:
        return survive + math.log1p(-chance_seen(model, gap))

    leftover = math.log1p(p.birth_density * s.p_detection / s.clutter_density)
    life = method.lifecycle
    confirm = math.log(life.confirm_probability / (1 - life.confirm_probability))
    labels = np.full(detections.n_points, -1)
    tracks: list[OneTrack] = []
    next_id = 0
    for t in range(detections.n_frames):
        now, points = detections.times[t], detections.frame(t)
        gains = np.full((len(tracks), len(points)), -np.inf)
        for i, track in enumerate(tracks):
            track.predict(round(now - detections.times[t - 1], 9))
            reach = p.max_speed * (now - track.last_time) + 6 * s.noise_sigma
            odds = track.odds
            missed = odds(miss(track.gap)) + leftover
            densities = track.densities(points).sum(axis=1)
            for j in near(track, points, reach, gate):
                if densities[j] <= 0:
                    continue
                gain = odds(hit(track.gap) + math.log(densities[j])) - missed
                if gain > 0:
                    gains[i, j] = gain
        confirmed = np.array([track.id >= 0 for track in tracks], dtype=bool)
        match = pair(tracks, points, np.where(confirmed[:, None], gains, -np.inf), method)
        taken = {j for several in match.values() for j in several}
        free = np.array([j not in taken for j in range(len(points))], dtype=bool)
        rest = np.where(~confirmed[:, None] & free, gains, -np.inf)
        match |= pair(tracks, points, rest, method)
        for i, track in enumerate(tracks):
            if i not in match:
                track.score += miss(track.gap)
                track.gap += 1
                continue
            several = sorted(match[i], key=lambda j, i=i: -gains[i, j])
            weights = np.array([track.densities(points[j]).sum() for j in several])
            y = weights @ points[several] / weights.sum()
            detection = int(detections.offsets[t]) + several[0]
            track.score += hit(track.gap) + math.log(track.densities(y).sum())
            track.update(y)
            track.gap, track.last, track.last_time = 0, y, now
            track.pending.append(detection)
            if track.id < 0 and track.score >= confirm:
                track.id, next_id = next_id, next_id + 1
            if track.id >= 0:
                labels[track.pending] = track.id
                track.pending = []
        for track in tracks:
            track.best = max(track.best, track.score)
        tracks = [
            track
            for track in tracks
            if track.gap < p.max_gap
            and (track.id >= 0 or track.best - track.score <= math.log(life.delete_odds))
        ]
        taken = {j for several in match.values() for j in several}
        for j, y in enumerate(points):
            if j not in taken:
                tracks.append(OneTrack(model, now, y, int(detections.offsets[t]) + j))
    return labels


def pair(tracks, points, gains, method) -> dict[int, list[int]]:
    if isinstance(method, am.GNN):
        n, m = gains.shape
        padded = np.zeros((n + m, n + m))
        padded[:n, :m] = np.where(np.isfinite(gains), -gains, 1e9)
        rows, columns = linear_sum_assignment(padded)
        return {int(i): [int(j)] for i, j in zip(rows, columns, strict=True) if i < n and j < m}
    n, m = gains.shape
    q = method.capacity
    far = np.array([track.distances(points) for track in tracks]).reshape(n, m)
    # Every track stands in the market q times; its further copies look near its favourite only.
    wanted: dict[tuple[int, int], list[int]] = {}
    for i in range(n):
        likes = sorted(np.flatnonzero(np.isfinite(gains[i])), key=lambda j, i=i: -gains[i, j])
        for copy in range(q):
            wanted[i, copy] = [
                j for j in likes
                if not copy or np.linalg.norm(points[j] - points[likes[0]]) <= method.merged_within
            ]  # fmt: skip
    copies = list(wanted)
    if method.proposers == "tracks":
        partners = propose(
            list(wanted.values()),
            {(p, j): far[i, j] for p, (i, _) in enumerate(copies) for j in range(m)},
        )
        pairs = [(copies[p][0], j) for p, j in enumerate(partners) if j >= 0]
    else:
        lists = [
            sorted(
                (p for p, key in enumerate(copies) if j in wanted[key]),
                key=lambda p, j=j: (far[copies[p][0], j], p),
            )
            for j in range(m)
        ]
        costs = {(j, p): -gains[i, j] for p, (i, _) in enumerate(copies) for j in range(m)}
        partners = propose(lists, costs)
        pairs = [(copies[p][0], j) for j, p in enumerate(partners) if p >= 0]
    match: dict[int, list[int]] = {}
    for i, j in pairs:
        match.setdefault(i, []).append(int(j))
    return match


def propose(lists, costs) -> list[int]:
    """Deferred acceptance in rounds: all the free propose at once (Gale & Shapley's own form)."""
    lists = [[int(r) for r in wishes] for wishes in lists]
    partner = [-1] * len(lists)
    holder: dict[int, int] = {}
    free = [p for p, wishes in enumerate(lists) if wishes]
    while free:
        again = []
        for p in free:
            if not lists[p]:
                continue
            r = lists[p].pop(0)
            rival = holder.get(r)
            if rival is None or (costs[p, r], p) < (costs[rival, r], rival):
                holder[r], partner[p] = p, r
                if rival is not None:
                    partner[rival] = -1
                    again.append(rival)
            else:
                again.append(p)
        free = again
    return partner
