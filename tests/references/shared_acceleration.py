"""Reference implementation of densities with shared accelerations: one detection at a time.

It shares nothing with the engine but the definitions: least squares by `lstsq`, rigid motions by
the SVD of `BodyByHand`, and the filter of every track in plain NumPy.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.model.compiled import steps_of
from tests.references.rigid_body import BodyByHand

if TYPE_CHECKING:
    import asterism as am

MOST, RIDGE = 6, 0.05
FIELD, RIGID, WIDE, BEGIN = (0.1, 0.5), (0.25, 1.0), 8.0, 4.0
N = 11


def log_sum(logs) -> float:
    logs = np.asarray(logs, dtype=float)
    return float(logs.max() + np.log(np.exp(logs - logs.max()).sum()))


def gaussian(y, at, variance: float) -> float:
    off = np.asarray(y) - at
    return -0.5 * float(off @ off / variance + len(off) * math.log(2 * math.pi * variance))


class Modes:
    """Predicted positions, their variances, and the logarithms of their weights."""

    def __init__(self, log_w, at, P) -> None:
        self.log_w, self.at, self.P = np.array(log_w), np.array(at), np.array(P)

    def density(self, y, r: float) -> float:
        each = [gaussian(y, a, P + r) for a, P in zip(self.at, self.P, strict=True)]
        return log_sum(self.log_w + each)

    def with_place(self, place, variance: float) -> Modes:
        """Condition on a measured place, by the formulas of a product of two Gaussians."""
        each = [gaussian(place, a, P + variance) for a, P in zip(self.at, self.P, strict=True)]
        log_w = self.log_w + each
        P = 1 / (1 / self.P + 1 / variance)
        at = P[:, None] * (self.at / self.P[:, None] + np.asarray(place) / variance)
        return Modes(log_w - log_sum(log_w), at, P)

    def center(self):
        return np.exp(self.log_w) @ self.at

    def variance(self, r: float) -> float:
        off2 = ((self.at - self.center()) ** 2).mean(axis=1)
        return float(np.exp(self.log_w) @ (self.P + r + off2))


class TrackFilter:
    """An interacting-multiple-model filter of one track."""

    def __init__(self, model: am.TrackingModel, y, extra: float) -> None:
        self.T = np.asarray(model.motion.mode_transitions)
        M, n = len(self.T), len(model.initial_covariance(len(y)))
        w = np.linalg.matrix_power(self.T, 4096)[0]
        self.w, self.r = w / w.sum(), model.sensor.noise_sigma**2
        self.x = np.zeros((M, n, len(y)))
        self.x[:, 0] = y
        self.P = np.tile(model.initial_covariance(len(y)), (M, 1, 1))
        self.P[:, 0, 0] += extra

    def predict(self, F, Q) -> None:
        joint = self.w[:, None] * self.T
        self.w = joint.sum(axis=0)
        x, P = self.x, self.P
        self.x, self.P = np.empty_like(x), np.empty_like(P)
        for m, w in enumerate(self.w):
            share = joint[:, m] / w
            mean = np.einsum("l,lid->id", share, x)
            off = x - mean
            cov = np.einsum("l,lij->ij", share, P)
            cov += np.einsum("l,lid,ljd->ij", share, off, off) / off.shape[2]
            self.x[m], self.P[m] = F[m] @ mean, F[m] @ cov @ F[m].T + Q[m]

    def modes(self) -> Modes:
        return Modes(np.log(self.w), self.x[:, 0], self.P[:, 0, 0])

    def update(self, y, extra: float) -> None:
        r = self.r + extra
        logs = np.array(
            [gaussian(y, x[0], P[0, 0] + r) for x, P in zip(self.x, self.P, strict=True)]
        )
        self.w = np.exp(np.log(self.w) + logs - log_sum(np.log(self.w) + logs))
        for m in range(len(self.w)):
            K = self.P[m][:, 0] / (self.P[m][0, 0] + r)
            self.x[m] = self.x[m] + K[:, None] * (y - self.x[m][0])
            self.P[m] = self.P[m] - np.outer(K, self.P[m][0])


def field_at(x, a, length2: float):
    """The acceleration at the marker, and the sum of the squared weights of the neighbours."""
    n, D = x.shape
    B = np.hstack([np.ones((n, 1)), x / math.sqrt(2 * length2)])
    rows = np.vstack([B, math.sqrt(RIDGE) * np.eye(D + 1)])
    each = np.vstack([np.eye(n), np.zeros((D + 1, n))])
    weights = np.linalg.lstsq(rows, each, rcond=None)[0][0]
    return weights @ a, float(weights @ weights)


def carried(a, b, v, then, r: float):
    body = BodyByHand(len(then), math.sqrt(r))
    at, own = body.turned(a, b, v, then, 1.0, r)
    middle = then - (1 / v) @ a / (1 / v).sum()
    alone = 0.3**2 * float(middle @ middle)
    if own < alone:
        return at, r + own
    return body.moved(a, b, v, then), r + alone


def densities(d, model, shared, labels, markers):
    """Log densities (N, 11) of the detections of tracks, and moments of the mixture (N, D + 1)."""
    found = np.full((d.n_points, N), np.nan)
    moments = np.full((d.n_points, d.n_axes + 1), np.nan)
    kind, F, Q = steps_of(model.motion, d.times)
    r, D = model.sensor.noise_sigma**2, d.n_axes
    seen: dict[tuple[int, int], list[int]] = {}
    for i, label in enumerate(labels):
        if label >= 0 and markers[label] >= 0:
            seen.setdefault((markers[label], int(d.frame_of[i])), []).append(i)

    def place(marker, t):
        own = seen.get((marker, t), [])
        return d.points[own[0]] if len(own) == 1 else None

    for k, marker in enumerate(markers):
        own = np.flatnonzero(np.asarray(labels) == k)
        filter_ = None
        for n, i in enumerate(own):
            extra = 0.0 if d.covariances is None else float(np.trace(d.covariances[i]) / D)
            if n == 0 or filter_ is None:
                filter_ = TrackFilter(model, d.points[i], extra)
                if marker >= 0:
                    t = int(d.frame_of[i])
                    found[i] = first_densities(shared, marker, d.points[i], t, place, r, extra)
                continue
            s, t = (int(d.frame_of[j]) for j in (own[n - 1], i))
            for step in range(s + 1, t + 1):
                filter_.predict(F[kind[step]], Q[kind[step]])
            if marker >= 0:
                each = predictions(
                    shared, marker, filter_.modes(), d.points[own[n - 1]], (s, t, n > 1), place, r
                )
                found[i] = [
                    -np.inf if p is None else p.density(d.points[i], r + extra) for p in each
                ]
                moments[i] = moments_of(each, shared.weights[marker], r)
            filter_.update(d.points[i], extra)
    return found, moments


def predictions(shared, marker, own, then, when, place, r):
    """The prediction by each component, or None."""
    s, t, is_moving = when
    out: list[Modes | None] = [None] * N
    out[0] = own
    pairs, shape, arms = [], [], []
    for b in range(shared.offsets[marker], shared.offsets[marker + 1]):
        j, v = int(shared.others[b]), shared.variances[b]
        now, was = place(j, t), place(j, s)
        if now is None:
            continue
        if len(shape) < MOST and np.isfinite(shared.shape[b, 0]):
            shape.append((shared.shape[b], now, v))
        if was is None or len(pairs) == MOST:
            continue
        pairs.append((was, now, v))
        before = place(j, s - 1) if is_moving and t == s + 1 else None
        if before is not None:
            arms.append((was - then, now - 2 * was + before, shared.distances[b]))
    if pairs or shape:
        out[3] = Modes(own.log_w, own.at, WIDE * (own.P + r) - r)
    if arms:
        x, a, length = (np.array(each) for each in zip(*arms, strict=True))
        step, squares = field_at(x, a, float((length**2).mean()))
        for k, beta in enumerate(FIELD):
            variance = beta * own.variance(r)
            out[1 + k] = own.with_place(own.center(), variance)
            out[4 + k] = own.with_place(own.center() + step, variance + 6 * r * squares)
    rigid = None
    if len(pairs) >= len(then):
        rigid = carried(*(np.array(each) for each in zip(*pairs, strict=True)), then, r)
        for k, factor in enumerate(RIGID):
            out[6 + k] = own.with_place(rigid[0], factor * rigid[1])
    if len(shape) >= len(then):
        a, b, v = (np.array(each) for each in zip(*shape, strict=True))
        formed = out[8] = own.with_place(*carried(a, b, v, shared.own_shape[marker], r))
        for k, factor in enumerate(RIGID):
            if rigid is not None:
                out[9 + k] = formed.with_place(rigid[0], factor * rigid[1])
    return out


def first_densities(shared, marker, y, t, place, r, extra):
    """Log densities (11,) of the first detection of a track: in the volume, or by the shape."""
    found = np.full(N, -np.inf)
    found[0] = -math.log(shared.volume)
    seen = []
    for b in range(shared.offsets[marker], shared.offsets[marker + 1]):
        now = place(int(shared.others[b]), t)
        if now is not None and np.isfinite(shared.shape[b, 0]) and len(seen) < MOST:
            seen.append((shared.shape[b], now, shared.variances[b]))
    if len(seen) >= len(y):
        a, b, v = (np.array(each) for each in zip(*seen, strict=True))
        at, variance = carried(a, b, v, shared.own_shape[marker], r)
        found[8] = gaussian(y, at, BEGIN * variance + r + extra)
    return found


def moments_of(each, weights, r):
    """Mean of a mixture, and its variance along an axis with the noise of the sensor."""
    w = np.concatenate([w * np.exp(p.log_w) for p, w in zip(each, weights, strict=True) if p])
    at, P = (np.concatenate([getattr(p, name) for p in each if p]) for name in ("at", "P"))
    mean = w @ at / w.sum()
    return np.append(mean, w @ (P + r + ((at - mean) ** 2).mean(axis=1)) / w.sum())


def gains(each, weights):
    """Log density of the mixture less that of the first component, of one detection."""
    has = np.isfinite(each)
    with np.errstate(divide="ignore"):
        logs = np.log(weights[has])
    return log_sum(logs - log_sum(logs) + each[has]) - each[0]
