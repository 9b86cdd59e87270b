"""Slow words for the moves of MCMC data association: q(ω → ω') counted from the partitions alone.

A partition is a set of tracks, each a tuple of detections; nothing here knows a chain's memory.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

import asterism as am
from asterism import _engine
from asterism.model.compiled import (
    SPEED_MARGIN_SIGMAS,
    motion_model,
    score_model,
    steps_of,
)
from tests.references.partitions import every_track
from tests.references.posterior import chance_seen

MOVES = (
    "birth", "death", "split", "merge", "extension", "reduction", "update", "switch", "insertion",
    "deletion", "transfer", "replacement", "exchange",
    "relocation",
)  # fmt: skip
INVERSE = {
    "birth": "death", "death": "birth", "split": "merge", "merge": "split",
    "extension": "reduction", "reduction": "extension", "insertion": "deletion",
    "deletion": "insertion",
}  # fmt: skip
STOP, FLOOR = 0.1, 1e-3

Track = tuple[int, ...]
Partition = frozenset[Track]


def as_partition(labels) -> Partition:
    n = max(labels, default=-1) + 1
    return frozenset(tuple(np.flatnonzero(np.asarray(labels) == k).tolist()) for k in range(n))


def make_chain(
    d: am.Detections, model: am.TrackingModel, *, informed: bool, stop: float = STOP,
    floor: float = FLOOR, weights=None, seed: int = 0, first_rules: bool = False,
    ascent: bool = False, frames: int | None = None,
):  # fmt: skip
    options = _engine.ChainOptions(
        weights=np.ones(len(MOVES)) if weights is None else np.asarray(weights, float),
        is_informed=informed, stop=stop, floor=floor, has_first_rules=first_rules,
        is_ascent=ascent,
    )  # fmt: skip
    chain = _engine.Chain(motion_model(model, d.n_axes), score_model(model), options, seed)
    kind, F, Q = steps_of(model.motion, d.times)
    for t, (time, points) in enumerate(d):
        if frames is None or t < frames:
            chain.add_frame(time, F[kind[t]], Q[kind[t]], np.ascontiguousarray(points))
    return chain


class Oracle:
    """The probability of drawing ω' from ω, move by move."""

    def __init__(self, d, model, *, informed, stop, floor, frozen=-1):
        self.d, self.model = d, model
        self.informed, self.stop, self.floor, self.frozen = informed, stop, floor, frozen
        self.frame = d.frame_of.tolist()
        self.n = d.n_points
        self.gap = model.population.max_gap
        self.after = [[j for j in range(self.n) if self.is_linkable(i, j)] for i in range(self.n)]
        self._scores = dict(zip(*every_track(d, model), strict=True))

    def is_linkable(self, i, j):
        d, p = self.d, self.model.population
        gap = self.frame[j] - self.frame[i]
        dt = d.times[self.frame[j]] - d.times[self.frame[i]]
        reach = p.max_speed * dt + SPEED_MARGIN_SIGMAS * self.model.sensor.noise_sigma
        return 1 <= gap <= self.gap and np.linalg.norm(d.points[i] - d.points[j]) <= reach

    def log_end(self, i) -> float:
        p = self.model.population.p_disappear
        left = self.d.n_frames - 1 - self.frame[i]
        E = 1.0
        for missed in reversed(range(left)):
            E = p + (1 - p) * (1 - chance_seen(self.model, missed)) * E
        if self.model.population.termination == "last":
            E = p if left else 1.0
        return math.log(E)

    def score(self, path: Track) -> float:
        """s(τ) of a track."""
        return self._scores.get(path, -math.inf)

    def so_far(self, path: Track) -> float:
        """The score up to the last detection, whatever comes after."""
        if len(path) == 1:
            s, p = self.model.sensor, self.model.population
            return math.log(p.birth_density * s.p_detection / s.clutter_density)
        return self.score(path) - self.log_end(path[-1])

    def total(self, w: Partition) -> float:
        return sum(self.score(track) for track in w)

    def is_frozen(self, i):
        return self.frame[i] <= self.frozen

    def n_frozen(self, track):
        return sum(self.is_frozen(i) for i in track)

    def free(self, w):
        taken = {i for track in w for i in track}
        return {i for i in range(self.n) if i not in taken and not self.is_frozen(i)}

    def growth(self, path: Track, keep: int, free: set[int], *, forced: bool) -> float:
        """Log probability that the first detections of a track grow into all of it."""
        total = 0.0
        for n in range(keep, len(path) + 1):
            i, j = path[n - 1], path[n] if n < len(path) else None
            step = self.informed_step if self.informed else self.uniform_step
            total += math.log(step(path[:n], i, j, free, forced=forced and n == keep))
        return total

    def uniform_step(self, _, i, j, free, *, forced):
        by_gap = [
            [k for k in self.after[i] if k in free and self.frame[k] - self.frame[i] == gap]
            for gap in range(1, self.gap + 1)
        ]
        if j is None:
            empty = sum(not some for some in by_gap)
            return self.stop + (1 - self.stop) * empty / self.gap
        goes_on = 1.0 if forced else 1 - self.stop
        return goes_on / self.gap / len(by_gap[self.frame[j] - self.frame[i] - 1])

    def informed_step(self, path, i, j, free, *, forced):
        weights = {
            k: math.exp(self.so_far((*path, k)) - self.so_far(path)) + self.floor
            for k in self.after[i]
            if k in free
        }
        if not forced:
            weights[None] = math.exp(self.log_end(i))
        return weights[j] / sum(weights.values())

    def log_q(self, move: str, with_: int, w: Partition, v: Partition) -> float:
        """Log q(ω → ω') of one kind of move, given what was drawn on the way."""
        return getattr(self, f"of_{move}")(w, v, with_)

    def of_birth(self, w, v, _):
        (new,) = v - w
        free = self.free(w)
        return -math.log(len(free)) + self.growth(new, 1, free, forced=True)

    def of_death(self, w, v, _):
        return -math.log(sum(self.n_frozen(t) == 0 for t in w))

    def of_split(self, w, v, _):
        (old,) = w - v
        cuts = [r for r in range(2, len(old) - 1) if r >= self.n_frozen(old)]
        return -math.log(len(w)) - math.log(len(cuts))

    def of_merge(self, w, v, _):
        (new,) = v - w
        (first,) = [t for t in w - v if t[0] == new[0]]
        seconds = [t for t in w if t[0] in self.after[first[-1]] and not self.is_frozen(t[0])]
        return -math.log(len(w)) - math.log(len(seconds))

    def of_extension(self, w, v, _):
        (new,), (old,) = v - w, w - v
        return -math.log(len(w)) + self.growth(new, len(old), self.free(w), forced=True)

    def of_reduction(self, w, v, _):
        (old,) = w - v
        keeps = [r for r in range(2, len(old)) if r >= self.n_frozen(old)]
        return -math.log(len(w)) - math.log(len(keeps))

    def of_update(self, w, v, keep):
        if w == v:  # any track may have grown into itself again, so the move is ambiguous
            return None
        (new,), (old,) = v - w, w - v
        keeps = [r for r in range(1, len(old) + 1) if r >= self.n_frozen(old)]
        free = self.free(w) | set(old[keep:])
        return (
            -math.log(len(w)) - math.log(len(keeps))
            + self.growth(new, keep, free, forced=keep == 1)
        )  # fmt: skip

    def links(self, w):
        return [(a, b) for t in w for a, b in itertools.pairwise(t) if not self.is_frozen(b)]

    def of_switch(self, w, v, b):
        # b stands for the link that leads to it in ω; in ω' the same a leads to d.
        links = {y: x for x, y in self.links(w)}
        (own,) = [t for t in w if b in t]
        a = links[b]
        partners = self.partners(w, own, a, b)
        return -math.log(len(links)) - math.log(len(partners))

    def partners(self, w, own, a, b):
        """With which of other tracks the link a → b may change tails: d after a, b in d's place."""
        found = []
        for t in w:
            for before, d in itertools.pairwise((None, *t)):
                if t == own or d not in self.after[a] or self.is_frozen(d):
                    continue
                fits = own[-1] != b if before is None else self.is_linkable(before, b)
                found += [d] if fits else []
        return found

    def of_insertion(self, w, v, x):
        return -math.log(len(self.free(w))) - math.log(self.slots(w, x))

    def slots(self, w, x):
        """Places of x in tracks of which it is none."""
        slots = 0
        for t in w:
            for r in range(len(t) + 1):
                before, after = (t[r - 1] if r else None), (t[r] if r < len(t) else None)
                fits = (before is None or self.is_linkable(before, x)) and (
                    after is None or (self.is_linkable(x, after) and not self.is_frozen(after))
                )
                slots += fits
        return slots

    def active_taken(self, w):
        return [i for t in w for i in t if not self.is_frozen(i)]

    def of_deletion(self, w, v, _):
        return -math.log(len(self.active_taken(w)))

    def of_transfer(self, w, v, b):
        (own,) = [t for t in w if b in t]
        ends = [t for t in w if t != own and self.is_linkable(t[-1], b)]
        return -math.log(len(self.links(w))) - math.log(len(ends))

    def of_replacement(self, w, v, x):
        others = [y for y in self.free(w) if self.frame[y] == self.frame[x]]
        return -math.log(len(self.active_taken(w))) - math.log(len(others))

    def of_exchange(self, w, v, x):
        others = [y for y in self.active_taken(w) if self.frame[y] == self.frame[x]]
        return -math.log(len(self.active_taken(w))) - math.log(len(others) - 1)

    def of_relocation(self, w, v, x):
        (own,) = [t for t in w if x in t]
        rest = w - {own} | {tuple(i for i in own if i != x)}
        return -math.log(len(self.active_taken(w))) - math.log(self.slots(rest, x) - 1)

    def with_back(self, move: str, with_: int, w: Partition, v: Partition) -> int:
        """What the inverse move draws on the way."""
        if move == "switch":
            a = {y: x for x, y in self.links(w)}[with_]
            return next(y for x, y in self.links(v) if x == a)
        if move == "replacement":
            (new,) = v - w
            (old,) = w - v
            return next(i for i in new if i not in old)
        return with_
