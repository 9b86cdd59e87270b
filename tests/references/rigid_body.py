"""Carried places as one would write them on a blackboard: all frames kept, an SVD, whole matrices.

It shares nothing with the engine but the definitions. Every marker must have been seen in the first
frame, and there be no more than twelve, so that each is everybody's neighbour.
"""

from __future__ import annotations

import numpy as np

MEMORY, LEAST_SEEN, LOOSE, LAG, ANCHORS = 400, 30, 0.3, 12, (0, 4, 10)


class BodyByHand:
    def __init__(self, n_axes: int, sigma: float) -> None:
        self.D, self.r = n_axes, sigma**2
        self.frames: list[dict[int, np.ndarray]] = []

    def see(self, markers, points) -> None:
        self.frames.append(dict(zip(map(int, markers), np.asarray(points), strict=True)))

    def bonds(self, marker: int, until: int) -> list[tuple[float, int]]:
        """Variance and number of the steady neighbours, after so many frames."""
        out = []
        for other in self.frames[0]:
            if other == marker:
                continue
            n, mean, variance = 0, 0.0, 0.0
            for frame in self.frames[:until]:
                if marker not in frame or other not in frame:
                    continue
                n += 1
                distance = np.linalg.norm(frame[marker] - frame[other])
                share, off = 1 / min(n, MEMORY), distance - mean
                mean += share * off
                variance += share * (off * (distance - mean) - variance)
            loose = np.hypot(3 * np.sqrt(variance + self.r), mean * (0.02 + 1 / n))
            if n >= LEAST_SEEN and loose <= LOOSE * mean:
                own = max(variance, 2 * self.r) + (mean * (0.01 + 1 / n)) ** 2
                out.append((own, other))
        return sorted(out)

    def place(self, a, b, v, then):
        """Fit b = R a + t; give R then + t and its variance, noise of `then` left out."""
        w = 1 / v
        ma, mb = w @ a / w.sum(), w @ b / w.sum()
        U, _, Vt = np.linalg.svd((a - ma).T * w @ (b - mb))
        flip = np.ones(self.D)
        flip[-1] = np.linalg.det(U @ Vt)
        R = (Vt.T * flip) @ U.T
        at, left = R @ (then - ma) + mb, (b - mb) - (a - ma) @ R.T
        freedom = len(a) * self.D - self.D * (self.D + 1) / 2
        chi2 = float(w @ (left**2).sum(axis=1)) / max(freedom, 1)
        arms, arm = b - mb, at - mb
        if self.D == 2:
            turn = arm @ arm / (w @ (arms**2).sum(axis=1))
        else:
            J = sum(
                wk * (x @ x * np.eye(3) - np.outer(x, x)) for wk, x in zip(w, arms, strict=True)
            )
            across = np.cross(arm, np.eye(3))
            turn = np.trace(across @ np.linalg.inv(J) @ across.T)
        return at, max(chi2, 1.0) * (1 / w.sum() + turn / self.D)

    def trust(self, marker: int):
        """Means over the last fifty looks: error, expected, shifted, moved."""
        means, counts = np.zeros(4), np.zeros(4)

        def learn(k: int, x: float) -> None:
            counts[k] += 1
            means[k] += (x - means[k]) / min(counts[k], 50)

        for now in range(LAG, len(self.frames)):
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
            near = min(self.mean_distance(marker, k, now + 1) for _, k in own) ** 2
            step = after[marker] - before[marker]
            learn(2, min(((step - (b[0] - a[0])) ** 2).sum(), near) / self.D)
            learn(3, float(step @ step))
            if len(own) < self.D:
                continue
            at, expected = self.place(a, b, v, before[marker])
            learn(0, min(((at - after[marker]) ** 2).sum(), near) / self.D)
            learn(1, expected)
        return means, counts

    def mean_distance(self, a: int, b: int, until: int) -> float:
        n, mean = 0, 0.0
        for frame in self.frames[:until]:
            if a in frame and b in frame:
                n += 1
                mean += (np.linalg.norm(frame[a] - frame[b]) - mean) / min(n, MEMORY)
        return mean

    def carry(self, marker: int, markers, points):
        """Place and variance of a hidden marker, and how many carry it; or None."""
        now = dict(zip(map(int, markers), np.asarray(points), strict=True))
        (error, expected, shifted, moved), counts = self.trust(marker)
        last = max(t for t, frame in enumerate(self.frames) if marker in frame)
        if counts[2] < 3:
            return None
        off = 1.0 if counts[1] == 0 else (error - 2 * self.r) / expected
        ways = []
        steady = self.bonds(marker, last + 2)
        for back in ANCHORS:
            frame = self.frames[last - back] if last >= back else {}
            if marker not in frame:
                continue
            own = [(v, k) for v, k in steady if k in frame][:16]
            own = [(v, k) for v, k in own if k in now][:6]
            if not own:
                continue
            bent = (len(self.frames) + 1 - (last - back + 1)) / LAG
            v = np.array([x for x, _ in own])
            a, b = (np.array([f[k] for _, k in own]) for f in (frame, now))
            at, variance = frame[marker] + b[0] - a[0], 4 * self.r + bent * shifted
            if len(own) >= self.D:
                turned, raw = self.place(a, b, v, frame[marker])
                if (own_v := self.r + max(off * bent, 0.02) * raw) < variance:
                    at, variance = turned, own_v
            beyond = np.linalg.norm(at - frame[marker]) - 2 * bent * np.sqrt(moved)
            ways.append((at, variance + (0.05 * max(beyond, 0)) ** 2, len(own)))
        if not ways:
            return None
        apart = [sum(np.linalg.norm(p - q) for q, *_ in ways) for p, *_ in ways]
        return ways[int(np.argmin(apart))]
