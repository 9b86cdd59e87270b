"""Reference implementation of rigid prediction: all frames kept, an SVD, whole matrices.

It shares nothing with the engine but the definitions. Every marker must have been seen in the first
frame, and there be no more than twelve, so that each is everybody's neighbour.
"""

from __future__ import annotations

import math

import numpy as np

MEMORY, BEND, LEAST_SEEN, STEADY, LAG, ANCHORS = 400, 0.01, 20, 0.1, 12, (0, 4, 10)


class BodyByHand:
    def __init__(
        self, n_axes: int, sigma: float, *, learnt_from: int = 0, bonds_only: bool = True
    ) -> None:
        self.D, self.r = n_axes, sigma**2
        self.learnt_from, self.bonds_only = learnt_from, bonds_only
        self.frames: list[dict[int, np.ndarray]] = []
        self.known: dict[tuple[int, int], list[tuple[float, int]]] = {}

    def see(self, markers, points) -> None:
        self.frames.append(dict(zip(map(int, markers), np.asarray(points), strict=True)))

    def bonds(self, marker: int, until: int) -> list[tuple[float, int]]:
        """Predictive variance and number of the neighbours after so many frames, in order."""
        key = marker, min(until, len(self.frames))
        if key not in self.known:
            self.known[key] = self.bonds_after(*key)
        return self.known[key]

    def bonds_after(self, marker: int, until: int) -> list[tuple[float, int]]:
        out = []
        for other in self.frames[0]:
            if other == marker:
                continue
            n, mean, variance = 0, 0.0, 0.0
            for frame in self.frames[self.learnt_from : until]:
                if marker not in frame or other not in frame:
                    continue
                n += 1
                distance = math.dist(frame[marker], frame[other])
                share, off = 1 / min(n, MEMORY), distance - mean
                mean += share * off
                variance += share * (off * (distance - mean) - variance)
            if n == 0:
                continue
            own = max(variance, 2 * self.r) + (mean * (BEND + 1 / n)) ** 2
            is_bond = n >= LEAST_SEEN and own <= (STEADY * mean) ** 2
            if is_bond or not self.bonds_only:
                out.append((own, other))
        return sorted(out)

    def moved(self, a, b, v, then):
        """Give `then` at its offset from the weighted mean of the neighbours."""
        w = 1 / v
        return then + w @ (b - a) / w.sum()

    def turned(self, a, b, v, then, kappa, r):
        """Fit b = R a + t; give R then + t and its variance, one r of noise left out."""
        w, n = 1 / v, len(a)
        ma, mb = w @ a / w.sum(), w @ b / w.sum()
        U, _, Vt = np.linalg.svd((a - ma).T * w @ (b - mb))
        flip = np.ones(self.D)
        flip[-1] = np.linalg.det(U @ Vt)
        R = (Vt.T * flip) @ U.T
        at, left = R @ (then - ma) + mb, (b - mb) - (a - ma) @ R.T
        freedom = n * self.D - self.D * (self.D + 1) / 2
        about = n / w.sum() * float(w @ (left**2).sum(axis=1)) / max(freedom, 1)
        arms, arm = b - mb, at - mb
        if self.D == 2:
            turn = arm @ arm / (w @ (arms**2).sum(axis=1))
        else:
            J = sum(
                wk * (x @ x * np.eye(3) - np.outer(x, x)) for wk, x in zip(w, arms, strict=True)
            )
            across = np.cross(arm, np.eye(3))
            turn = np.trace(across @ np.linalg.inv(J) @ across.T)
        own = max((about - 2 * self.r) / 3, kappa * n / w.sum())
        return at, own * (1 + 1 / n) + max(own, r) * w.sum() / n * turn / self.D

    def trust(self, marker: int):
        """Means over the last fifty looks, error and expected, and how many looks there were."""
        means, counts = np.zeros(2), np.zeros(2)
        n_judged = 0

        def learn(k: int, x: float) -> None:
            counts[k] += 1
            means[k] += (x - means[k]) / min(counts[k], 50)

        for now in range(max(LAG, self.learnt_from), len(self.frames)):
            if (now + 1 + marker) % 4:
                continue
            before, after = self.frames[now - LAG], self.frames[now]
            if marker not in before or marker not in after:
                continue
            own = [(v, k) for v, k in self.bonds(marker, now + 1) if k in before and k in after][:6]
            if not own:
                continue
            v = np.array([x for x, _ in own])
            a, b = (np.array([f[k] for _, k in own]) for f in (before, after))
            near = ((a - before[marker]) ** 2).sum(axis=1).min()
            n_judged += 1
            if len(own) < self.D:
                continue
            at, expected = self.turned(a, b, v, before[marker], 1, 0)
            learn(0, min(((at - after[marker]) ** 2).sum(), near) / self.D)
            learn(1, expected)
        return means, counts, n_judged

    def way(self, marker: int, until: int, then: int, now, bent: float, r: float, trust):
        """Place, variance and neighbours of a marker by where it was in a frame; or None."""
        (error, expected), counts, _ = trust
        off = 1.0 if counts[1] == 0 else (error - 2 * self.r) / expected
        frame = self.frames[then] if then >= 0 else {}
        own = [(v, k) for v, k in self.bonds(marker, until) if k in frame][:16]
        own = [(v, k) for v, k in own if k in now][:6]
        if marker not in frame or not own:
            return None
        v = np.array([x for x, _ in own])
        a, b = (np.array([f[k] for _, k in own]) for f in (frame, now))
        middle = frame[marker] - (1 / v) @ a / (1 / v).sum()
        at, variance = self.moved(a, b, v, frame[marker]), 0.3**2 * (middle @ middle)
        if len(own) >= self.D:
            turned, own_v = self.turned(a, b, v, frame[marker], max(off * bent, 0.02), r)
            if own_v < variance:
                at, variance = turned, own_v
        return at, r + variance, len(own)

    def carry(self, marker: int, markers, points):
        """Place and variance of an occluded marker, and how many carry it; or None."""
        now = dict(zip(map(int, markers), np.asarray(points), strict=True))
        last = max(t for t, frame in enumerate(self.frames) if marker in frame)
        trust = self.trust(marker)
        if trust[2] < 3:
            return None
        ways = []
        for then in (last - back for back in ANCHORS):
            bent = (len(self.frames) - then) / LAG
            ways.append(self.way(marker, last + 2, then, now, bent, self.r, trust))
        ways = [way for way in ways if way is not None]
        if not ways:
            return None
        apart = [sum(np.linalg.norm(p - q) for q, *_ in ways) for p, *_ in ways]
        return ways[int(np.argmin(apart))]
