"""Large scenes, slowly and plainly: dense gains with their look-ahead, an assignment by SciPy, and
starts by listing every chain of detections."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

if TYPE_CHECKING:
    import asterism as am

DROP = 4.0  # nats below zero at which a detection is no candidate, whatever follows


@dataclass
class Filter:
    """Kalman filter of one track with one motion, and its log odds."""

    model: am.TrackingModel
    x: np.ndarray  # (D, n)
    P: np.ndarray  # (n, n)
    last: np.ndarray
    last_time: float
    score: float
    gap: int = 0
    is_confirmed: bool = False
    path: list = field(default_factory=list)

    @classmethod
    def begin(cls, model, y, time):
        n_axes, H = len(y), model.motion.observation
        x = np.outer(y, H / (H @ H))
        s, p = model.sensor, model.population
        score = math.log(p.birth_density) - math.log(s.clutter_density) + math.log(s.p_detection)
        return cls(model, x, model.initial_covariance(n_axes), y, time, score)

    def predicted(self, dt):
        F, Q = self.model.motion.transition([dt])[0], self.model.motion.process_noise([dt])[0]
        return self._with(x=self.x @ F.T, P=F @ self.P @ F.T + Q)

    def _with(self, **changes):
        return Filter(**{**self.__dict__, **changes})

    @property
    def S(self):
        H = self.model.motion.observation
        return H @ self.P @ H + self.model.sensor.noise_sigma**2

    @property
    def centre(self):
        return self.x @ self.model.motion.observation

    def log_likelihood(self, y):
        d2 = ((y - self.centre) ** 2).sum()
        return -0.5 * (len(y) * math.log(2 * math.pi * self.S) + d2 / self.S)

    def updated(self, y, time):
        H, S = self.model.motion.observation, self.S
        K = self.P @ H / S
        x = self.x + np.outer(y - self.centre, K)
        P = self.P - np.outer(K, K) * S
        score = self.score + self.hit() + self.log_likelihood(y)
        return self._with(x=x, P=P, last=y, last_time=time, score=score, gap=0)

    def missed(self):
        return self._with(score=self.score + self.miss(), gap=self.gap + 1)

    def hit(self):
        s = self.model.sensor
        p = s.p_detection if self.gap == 0 else s.p_after_miss
        stay = math.log1p(-self.model.population.p_disappear)
        return stay + math.log(p) - math.log(s.clutter_density)

    def miss(self):
        s = self.model.sensor
        p = s.p_detection if self.gap == 0 else s.p_after_miss
        return math.log1p(-self.model.population.p_disappear) + math.log1p(-p)

    def may_take(self, y, time, gate):
        reach = self.model.population.max_speed * (time - self.last_time)
        reach += 6 * self.model.sensor.noise_sigma
        near = np.linalg.norm(y - self.last) <= reach
        return near and ((y - self.centre) ** 2).sum() <= gate * self.S


def leftover(model):
    s, p = model.sensor, model.population
    return math.log1p(p.birth_density * s.p_detection / s.clutter_density)


def value(track, frames, regions, gate, f):
    """Value of the best continuation through the frames from f on."""
    if f == len(frames) or track.gap >= track.model.population.max_gap:
        return 0.0
    time, points = frames[f]
    track = track.predicted(time - frames[f - 1][0])
    best = track.miss() + value(track._with(gap=track.gap + 1), frames, regions, gate, f + 1)
    for y in points:
        log = track.log_likelihood(y)
        own = track.hit() + log - leftover(track.model)
        if not track.may_take(y, time, gate) or not regions(f, y) or own < track.miss():
            continue
        best = max(best, own + value(track.updated(y, time), frames, regions, gate, f + 1))
    return best


def gains(tracks, frames, gate):
    """Gain of every pair of track and detection of the first frame, -inf where there is none.

    The tracks are predicted to the first frame.
    """
    time, points = frames[0]
    out = np.full((len(tracks), len(points)), -np.inf)
    for i, track in enumerate(tracks):
        alone = [track]
        for (before, _), (now, _) in itertools.pairwise(frames):
            alone.append(alone[-1].predicted(now - before))

        def regions(f, y, alone=alone):
            return ((y - alone[f].centre) ** 2).sum() <= gate * alone[f].S

        without = track.miss()
        without += value(track._with(gap=track.gap + 1), frames, regions, gate, 1)
        for j, y in enumerate(points):
            if not track.may_take(y, time, gate):
                continue
            with_it = track.hit() + track.log_likelihood(y)
            if with_it - track.miss() - leftover(track.model) < -DROP:
                continue
            with_it += value(track.updated(y, time), frames, regions, gate, 1)
            if track.is_confirmed:
                out[i, j] = with_it - without - leftover(track.model)
            else:
                odds = np.logaddexp(0, track.score + with_it)
                out[i, j] = odds - np.logaddexp(0, track.score + without) - leftover(track.model)
    return out


def assigned(gain):
    """Detection of each track in the assignment with the largest total gain, -1 for none."""
    cost = -np.where(np.isfinite(gain), np.maximum(gain, 0), 0.0)
    match = np.full(len(gain), -1)
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        if gain[i, j] > 0:
            match[i] = j
    return match


def starts(model, frames, *, gate, min_detections, max_missed):
    """Chains of detections that start tracks, best first without a common detection.

    Returns (log odds, index in each frame or -1) ordered by the first detection.
    """
    found = []

    def extend(track, path):
        f = len(path)
        if f == len(frames):
            if sum(j >= 0 for j in path) >= min_detections and track.score > 0:
                found.append((track.score, tuple(path)))
            return
        time, points = frames[f]
        track = track.predicted(time - frames[f - 1][0])
        for j, y in enumerate(points):
            if track.may_take(y, time, gate):
                extend(track.updated(y, time), [*path, j])
        if f > 1 and sum(j < 0 for j in path) < max_missed:
            extend(track.missed(), [*path, -1])

    time, points = frames[0]
    for j, y in enumerate(points):
        extend(Filter.begin(model, y, time), [j])
    found.sort(key=lambda one: (-one[0], one[1]))
    taken, chosen = set(), []
    for score, path in found:
        own = {(f, j) for f, j in enumerate(path) if j >= 0}
        if not own & taken:
            taken |= own
            chosen.append((score, path))
    return sorted(chosen, key=lambda one: one[1])


def chi2(n_axes, probability):
    return float(chdtri(n_axes, probability))
