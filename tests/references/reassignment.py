"""Assignment of open detections frame by frame, and exchange of pairs of tracks, by enumeration."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student

from tests.references.distance_profiles import log_ratio_to_unknown, profile_of

DISTANCES, MOTION, MAX_LOSS = 1.5, 0.25, 3.0


class Reassignment:
    """Labels of the detections of a short capture, with the score of a detection in a track.

    Parameters
    ----------
    points, frame, labels, is_open, ghost : ndarray
        Point, frame, track (-1 for none) of each detection, whether it may change, and log odds of
        its being a ghost.
    sigma : ndarray
        Deviation of a coordinate of each track from smooth motion.
    noise, log_clutter, change, max_gap : float
        As for the engine.
    """

    def __init__(
        self, points, frame, labels, is_open, ghost, sigma, noise, log_clutter, change, max_gap
    ):
        self.points, self.frame, self.labels = points, frame, labels.copy()
        self.is_open, self.ghost, self.sigma = is_open, ghost, sigma
        self.log_clutter, self.change, self.max_gap = log_clutter, change, max_gap
        positions = np.full((frame.max() + 1, len(sigma), points.shape[1]), np.nan)
        positions[frame[labels >= 0], labels[labels >= 0]] = points[labels >= 0]
        self.profiles = [profile_of(positions, noise, k) for k in range(len(sigma))]
        self.spans = [
            (own.min() - max_gap, own.max() + max_gap) if len(own) else (1, 0)
            for own in (frame[labels == k] for k in range(len(sigma)))
        ]

    def assigned(self):
        """Return the labels after the frames and after the pairs, in the order of the engine."""
        for t in range(self.frame.max() + 1):
            self.assign(t)
        for pair in itertools.combinations(range(len(self.sigma)), 2):
            self.exchange(*pair)
        return self.labels

    def at(self, t, k):
        """Return the detection of a track in a frame, None without one."""
        found = np.flatnonzero((self.frame == t) & (self.labels == k))
        return int(found[0]) if len(found) else None

    def is_near(self, t, k):
        return self.spans[k][0] <= t <= self.spans[k][1]

    def distances(self, i, k, without):
        """Return the score of a detection in a track by its distances, None without enough."""
        others = np.flatnonzero((self.frame == self.frame[i]) & (self.labels >= 0))
        there = {
            int(self.labels[j]): float(np.linalg.norm(self.points[i] - self.points[j]))
            for j in others
            if self.labels[j] not in (without, k)
        }
        ratio = log_ratio_to_unknown(there, self.profiles[k])
        return None if ratio is None else DISTANCES * ratio

    def motion(self, i, k, around):
        """Return the score of a detection by the polynomial through others of its track."""
        if not around:
            return 0.0
        when = self.frame[around] - self.frame[i]
        mean = [np.polyfit(when, axis, len(when) - 1)[-1] for axis in self.points[around].T]
        before, after = abs(when[when < 0]), when[when > 0]
        if len(before) and len(after):
            half = (before.min() + after.min()) / 2
            growth = 1 + half ** (2 * min(len(when), 3)) / 4
        else:
            gap = abs(when).min()
            growth = 4 + 9 * gap**4 if len(when) > 1 else 100 * gap**2
        n, spread = len(mean), self.sigma[k] * np.sqrt(growth)
        off = np.linalg.norm(self.points[i] - mean)
        peak = -n / 2 * np.log(2 * np.pi * spread**2)
        # Student's t of n coordinates, whose density falls with the radius like that of one.
        shape = student.logpdf(off / spread, 3) - student.logpdf(0, 3)
        return MOTION * (peak + shape * (3 + n) / 4 - self.log_clutter)

    def around(self, t, k):
        """Return the nearest two detections of a track before and after a frame."""
        own = np.flatnonzero((self.labels == k) & (abs(self.frame - t) <= self.max_gap))
        return [*own[self.frame[own] < t][-2:], *own[self.frame[own] > t][:2]]

    def support(self, i):
        """Return the score of a detection in its own track, 0 without one."""
        k = self.labels[i]
        if k < 0:
            return 0.0
        return (self.distances(i, k, k) or 0) + self.motion(i, k, self.around(self.frame[i], k))

    def assign(self, t):
        """Assign the open detections of a frame to the tracks."""
        rows = np.flatnonzero((self.frame == t) & self.is_open)
        gains = np.zeros((len(rows), len(self.sigma)))
        for (r, i), k in itertools.product(enumerate(rows), range(len(self.sigma))):
            held, now = self.at(t, k), self.labels[i]
            if (held is not None and not self.is_open[held]) or not self.is_near(t, k):
                continue
            distances = self.distances(i, k, now)
            if distances is None and k != now:
                continue
            gain = self.change if k == now else 0
            if distances is not None:
                gain += distances + self.motion(i, k, self.around(t, k))
            if now < 0:
                gain -= self.change + self.ghost[i]
            gains[r, k] = max(gain, 0)
        self.labels[rows] = -1
        for r, k in zip(*linear_sum_assignment(-gains), strict=True):
            if gains[r, k] > 0:
                self.labels[rows[r]] = k

    def exchange(self, a, b):
        """Exchange two tracks in the best of all sets of frames."""
        frames = [(self.at(t, a), self.at(t, b)) for t in range(self.frame.max() + 1)]
        frames = [pair for pair in frames if pair != (None, None)]
        gains = [self.gain(i, j, a, b) for i, j in frames]
        known = {}

        def motion(n, exchanged):
            key = n, exchanged[max(n - 2, 0) : n + 3]
            if key not in known:
                known[key] = sum(
                    self.motion_at(n, exchanged, frames, *of) for of in ((0, a), (1, b))
                )
            return known[key]

        none = tuple(False for _ in frames)
        best, best_score = none, 1e-9
        for exchanged in itertools.product(*((False, True)[: 1 + (g is not None)] for g in gains)):
            starts = sum(x and not before for before, x in itertools.pairwise((False, *exchanged)))
            score = sum(g for g, x in zip(gains, exchanged, strict=True) if x)
            score += sum(motion(n, exchanged) - motion(n, none) for n in range(len(frames)))
            if score - self.change * starts > best_score:
                best, best_score = exchanged, score - self.change * starts
        for (i, j), x in zip(frames, best, strict=True):
            if x and i is not None:
                self.labels[i] = b
            if x and j is not None:
                self.labels[j] = a

    def gain(self, i, j, a, b):
        """Return what an exchange in a frame gains by distances, None where it is impossible."""
        total = 0.0
        for detection, own, other in ((i, a, b), (j, b, a)):
            if detection is None:
                continue
            before = self.distances(detection, own, other)
            after = self.distances(detection, other, own)
            t = self.frame[detection]
            if before is None or after is None or not self.is_open[detection]:
                return None
            if not (self.is_near(t, a) and self.is_near(t, b)):
                return None
            total += after - before
        return total if total > -MAX_LOSS else None

    def motion_at(self, n, exchanged, frames, side, k):
        """Return the motion of one of two tracks at a frame, exchanged in some frames."""
        near = range(max(n - 2, 0), min(n + 3, len(frames)))
        own = {m: frames[m][side ^ exchanged[m]] for m in near}
        if own[n] is None:
            return 0.0
        far = {m: abs(self.frame[i] - self.frame[own[n]]) for m, i in own.items() if i is not None}
        return self.motion(own[n], k, [own[m] for m in far if 0 < far[m] <= self.max_gap])
