"""The peer: Kalman filters and SciPy's assignment in a NumPy loop, as one would write it today.

Vectorised over tracks, one assignment a frame on the full matrix; same gate, same scores, same life
of a track as `asterism.GNN`, without its groups, its grid and its precedence of confirmed tracks.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

import asterism as am
from peers.peer import Peer, Setting, length_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PEER", "track_in_numpy"]


def track_in_numpy(detections: am.Detections, model: am.TrackingModel) -> NDArray[np.int64]:
    """Label every detection; one motion of two states an axis."""
    (motion,) = model.motion.modes
    s, p = model.sensor, model.population
    D = detections.n_axes
    # One long function on purpose: the loop as one would write it by hand, nothing hidden.
    gate = chi2.isf(1e-9, D)
    r = s.noise_sigma**2
    P0 = model.initial_covariance(D)
    hit = math.log1p(-p.p_disappear) + math.log(s.p_detection / s.clutter_density)
    miss = math.log1p(-p.p_disappear) + math.log1p(-s.p_detection)
    leftover = math.log1p(p.birth_density * s.p_detection / s.clutter_density)
    birth = math.log(p.birth_density * s.p_detection / s.clutter_density)
    labels = np.full(detections.n_points, -1)
    x, P = np.empty((0, 2, D)), np.empty((0, 2, 2))
    score, best = np.empty(0), np.empty(0)
    last, seen, ids, gap = np.empty((0, D)), np.empty(0), np.empty(0, int), np.empty(0, int)
    pending: list[list[int]] = []
    next_id = 0
    for t, (now, points) in enumerate(detections):
        first = int(detections.offsets[t])
        taken = np.zeros(len(points), bool)
        if len(x):
            dt = np.array([now - detections.times[t - 1]])
            F, Q = motion.transition(dt)[0], motion.process_noise(dt)[0]
            x, P = F @ x, F @ P @ F.T + Q
            S = P[:, 0, 0] + r
            e2 = ((points[None] - x[:, None, 0]) ** 2).sum(axis=2)
            far = ((points[None] - last[:, None]) ** 2).sum(axis=2)
            reach = p.max_speed * (now - seen) + 6 * s.noise_sigma
            density = -0.5 * (D * np.log(2 * np.pi * S)[:, None] + e2 / S[:, None])
            gain = np.logaddexp(0, score[:, None] + hit + density)
            gain -= np.logaddexp(0, score + miss)[:, None] + leftover
            gain[(e2 > gate * S[:, None]) | (far > reach[:, None] ** 2) | (gain <= 0)] = 0
            rows, columns = linear_sum_assignment(-gain)
            is_pair = gain[rows, columns] > 0
            rows, columns = rows[is_pair], columns[is_pair]
            taken[columns] = True
            is_hit = np.zeros(len(x), bool)
            is_hit[rows] = True
            score[~is_hit] += miss
            gap[~is_hit] += 1
            score[rows] += hit + density[rows, columns]
            K = P[rows, :, 0] / S[rows, None]
            x[rows] += K[:, :, None] * (points[columns] - x[rows, 0])[:, None]
            P[rows] -= K[:, :, None] * K[:, None] * S[rows, None, None]
            last[rows], seen[rows], gap[rows] = points[columns], now, 0
            for i, j in zip(rows, columns, strict=True):
                if ids[i] >= 0:
                    labels[first + j] = ids[i]
                    continue
                pending[i].append(first + int(j))
                if score[i] >= math.log(0.999 / 0.001):
                    ids[i], next_id = next_id, next_id + 1
                    labels[pending[i]] = ids[i]
            best = np.maximum(best, score)
            keep = (gap < p.max_gap) & ((ids >= 0) | (best - score <= math.log(300)))
            x, P, score, best = x[keep], P[keep], score[keep], best[keep]
            last, seen, ids, gap = last[keep], seen[keep], ids[keep], gap[keep]
            pending = [pending[i] for i in np.flatnonzero(keep)]
        new = points[~taken]
        n = len(new)
        x = np.concatenate([x, np.stack([new, np.zeros_like(new)], axis=1)])
        P = np.concatenate([P, np.broadcast_to(P0, (n, 2, 2))])
        score, best = np.append(score, np.full(n, birth)), np.append(best, np.full(n, birth))
        last, seen = np.concatenate([last, new]), np.append(seen, np.full(n, now))
        ids, gap = np.append(ids, np.full(n, -1)), np.append(gap, np.zeros(n, int))
        pending += [[first + int(j)] for j in np.flatnonzero(~taken)]
    return labels


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    scale = length_of(d)
    volume = float(np.prod(np.ptp(d.points, axis=0) + scale))
    clutter = setting["clutter"] / volume
    model = am.TrackingModel(
        motion=am.DWNA(
            acceleration_sigma=setting["process"] * scale, velocity_sigma=setting["speed"] * scale
        ),
        sensor=am.Sensor(
            noise_sigma=setting["noise"] * scale,
            p_detection=setting["detected"],
            clutter_density=clutter,
        ),
        population=am.Population(
            birth_density=0.1 * clutter, p_disappear=1e-4,
            max_speed=10 * setting["speed"] * scale, max_gap=int(setting["max_gap"]),
        ),
    )  # fmt: skip
    return track_in_numpy(d, model)


PEER = Peer(
    name="Kalman + assignment",
    package="",
    space={
        "process": (0.02, 3.0), "noise": (0.01, 2.0), "speed": (0.5, 10.0), "clutter": (0.01, 30.0),
        "detected": (0.7, 0.99), "max_gap": (3, 60),
    },
    label=label,
)  # fmt: skip
