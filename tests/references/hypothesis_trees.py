"""Reference implementation of track splitting: tracks split into branches over a window of frames.

Lists of copies, dictionaries, SciPy; it shares nothing with the engine but the definitions.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtrc, chdtri
from scipy.stats import chi2

import asterism as am
from asterism.tracking.methods.track_splitting import chi2_limits
from tests.references.frame_by_frame import OneTrack, near, pair, propose
from tests.references.jpda import components, marginals_of
from tests.references.posterior import chance_seen


class Branch(OneTrack):
    """A track, or one of the ways on from it."""

    chi2, updates, n_taken, has_ended = 0.0, 0, 0, False

    def begin(self) -> None:
        self.path: dict[int, int] = {}
        self.squares: dict[int, float] = {}
        self.branches: list[Branch] = []
        self.key = 0

    def fork(self) -> Branch:
        other = object.__new__(Branch)
        other.__dict__.update(self.__dict__)
        other.path, other.squares = dict(self.path), dict(self.squares)
        return other

    def nis(self, points) -> np.ndarray:
        """Normalised innovation squared of a point, or of each, over the mixture of motions."""
        squares, D = self.squares_of(points), points.shape[-1]
        if squares.shape[-1] == 1:
            return squares[..., 0]
        return chdtri(D, chdtrc(D, squares) @ self.w)


class Options:
    """Options of a method that concern its branches."""

    def __init__(self, method, n_axes: int) -> None:
        if isinstance(method, am.TrackSplitting):
            self.limits = chi2_limits(method.alpha, n_axes, method.fading)
            self.fading, self.independent = method.fading, method.independent
            self.most, self.merge = method.max_branches, method.merge_last
            self.drop = math.log(method.prune_odds)
        else:
            self.limits, self.fading, self.independent = [math.inf] * 5000, 1.0, False
            self.most, self.merge, self.drop = 30, method.window, math.log(1e6)


def trees_by_hand(detections: am.Detections, method, model: am.TrackingModel):
    """Labels of every detection and, of trees with an assignment, their confidence."""
    s, p = model.sensor, model.population
    o = Options(method, detections.n_axes)
    gate = chi2.isf(method.gate.probability, detections.n_axes)
    survive = math.log1p(-p.p_disappear)
    over = math.log1p(p.birth_density * s.p_detection / s.clutter_density)
    life = method.lifecycle
    confirm = math.log(life.confirm_probability / (1 - life.confirm_probability))
    labels = np.full(detections.n_points, -1)
    confidence = np.zeros(detections.n_points)
    tracks: list[Branch] = []
    claims: dict[int, dict[tuple[int, int], float]] = {}
    count = {"ids": 0, "keys": 0}

    def hit(gap: int) -> float:
        return survive + math.log(chance_seen(model, gap) / s.clutter_density)

    def miss(gap: int) -> float:
        return survive + math.log1p(-chance_seen(model, gap))

    def step_to(t: int) -> float:
        return round(detections.times[t] - detections.times[t - 1], 9)

    def crowding(t: int, key: int, j: int) -> float:
        return math.log1p(
            sum(v for (k, column), v in claims[t].items() if column == j and k != key)
        )

    def log_odds(b: Branch) -> float:
        return b.score - b.n_taken * over

    def root(track: Branch) -> Branch:
        b = track.fork()
        b.path, b.squares, b.branches = {}, {}, []
        b.n_taken, b.has_ended = 0, track.gap >= p.max_gap
        return b

    def grow(t: int, track: Branch, n_open: int) -> None:
        grown: list[Branch] = []
        for parent in track.branches:
            b = parent.fork()
            b.path[t], b.squares[t] = -1, 0.0
            if b.has_ended:
                grown.append(b)
                continue
            b.predict(step_to(t))
            reach = p.max_speed * (detections.times[t] - b.last_time) + 6 * s.noise_sigma
            points = detections.frame(t)
            likelihood, nis = b.densities(points).sum(axis=1), b.nis(points)
            for j in near(b, points, reach, gate):
                y = points[j]
                if likelihood[j] <= 0:
                    continue
                won = hit(b.gap) + math.log(likelihood[j])
                if track.id >= 0 and won <= miss(b.gap) + over - o.drop:
                    continue  # never kept
                sum_ = o.fading * b.chi2 + nis[j]
                if sum_ > o.limits[min(b.updates, len(o.limits) - 1)]:
                    continue
                child = b.fork()
                child.squares[t] = b.distance(y)
                child.update(y)
                child.score += won - crowding(t, track.key, j)
                child.chi2, child.updates, child.n_taken = sum_, b.updates + 1, b.n_taken + 1
                child.last, child.last_time, child.gap = y, detections.times[t], 0
                child.path[t] = j
                grown.append(child)
            b.score += miss(b.gap)
            b.gap += 1
            b.has_ended = b.gap >= p.max_gap
            grown.append(b)
        grown.sort(key=lambda b: -log_odds(b))
        kept: list[Branch] = []
        for b in grown:
            if log_odds(b) < log_odds(grown[0]) - o.drop:
                break
            last = [b.path.get(t - k) for k in range(o.merge)]
            if n_open > o.merge and any(
                [a.path.get(t - k) for k in range(o.merge)] == last for a in kept
            ):
                continue
            if len(kept) < o.most:
                kept.append(b)
        track.branches = kept

    def odds(track: Branch, b: Branch, extra: float) -> float:
        if track.id >= 0:
            return log_odds(b) + extra
        return float(np.logaddexp(0, b.score + extra)) - b.n_taken * over

    def ways(t: int, n_open: int, track: Branch):
        best: dict[int, Branch] = {}
        weight: dict[int, float] = {}
        top = max(map(log_odds, track.branches))
        for b in track.branches:
            j = b.path[t]
            best.setdefault(j, b)
            extra = crowding(t, track.key, j) if j >= 0 else 0.0
            weight[j] = weight.get(j, 0.0) + math.exp(log_odds(b) - top + extra)
        weight.setdefault(-1, math.exp(-o.drop))
        missed = top - o.drop
        if -1 in best:
            missed = odds(track, best[-1], 0.0)
        elif track.id < 0:
            missed = float(np.logaddexp(0, missed))
        new = {j: newborn(t, n_open, track, b) for j, b in best.items() if j >= 0}
        scaled = {j: math.exp(v - top) for j, v in new.items()}
        return best, weight, missed, new, scaled

    def newborn(t: int, n_open: int, track: Branch, b: Branch) -> float:
        """Log odds of a new marker that takes a branch over, the track having ended."""
        if track.id < 0:
            return -math.inf
        j = b.path[t]
        expected = track.fork()
        expected.predict(step_to(t))
        own = hit(track.gap) + math.log(expected.densities(detections.frame(t)[j]).sum())
        n_missed = min(n_open, p.max_gap - track.gap)
        gone = track.score + sum(miss(track.gap + k) for k in range(n_missed))
        future = b.score + crowding(t, track.key, j) - track.score - own - over * (b.n_taken - 1)
        birth = math.log(p.birth_density * s.p_detection / s.clutter_density)
        return gone + birth - over + math.log(math.expm1(future)) if future > 0 else -math.inf

    def probabilities(t: int, own: list[int], found, taken: set[int]):
        """Marginals over all ways of sharing out the frame."""
        weights = np.zeros((len(own), len(detections.frame(t))))
        missed = np.array([found[i][1][-1] for i in own])
        for row, i in enumerate(own):
            for j, w in found[i][1].items():
                if j < 0 or j in taken:
                    continue
                # An event without the pair weighs as much as the miss and the newborn together.
                w *= missed[row] / (missed[row] + found[i][4][j])
                if w > math.exp(-20.7) * missed[row]:
                    weights[row, j] = w
        beta = np.zeros(weights.shape)
        for rows in components(weights):
            beta[rows] = marginals_of(weights[rows], missed[rows])[0][:, :-1]
        return {i: beta[row] for row, i in enumerate(own)}

    def decide(t: int, later: list[int]) -> None:
        points, first = detections.frame(t), int(detections.offsets[t])
        taken: set[int] = set()
        match: dict[int, int] = {}
        found = {i: ways(t, 1 + len(later), track) for i, track in enumerate(tracks)}
        sure: dict[int, np.ndarray] = {}
        for is_confirmed in (True, False):
            own = [i for i, track in enumerate(tracks) if (track.id >= 0) == is_confirmed]
            sure |= probabilities(t, own, found, taken)
            gains = np.full((len(tracks), len(points)), -np.inf)
            squares = np.full(gains.shape, np.inf)
            for i, track in enumerate(tracks):
                if (track.id >= 0) != is_confirmed:
                    continue
                best, _, missed, new, _ = found[i]
                for j, b in best.items():
                    if j < 0 or j in taken:
                        continue
                    gain = odds(track, b, crowding(t, track.key, j))
                    gain -= float(np.logaddexp(missed, new[j]))
                    if gain > 0:
                        gains[i, j] = gain
                        squares[i, j] = sum(b.squares.values()) / b.n_taken
            match |= resolve(gains, squares, method)
            taken |= set(match.values())
        free = np.ones(len(points))
        for i, track in enumerate(tracks):
            if track.id >= 0:
                free -= sure[i]
        confidence[first : first + len(points)] = np.clip(free, 0, 1)
        for i, track in enumerate(tracks):
            j = match.get(i, -1)
            own = track.branches[0].path[t] if o.independent else j
            track.predict(step_to(t))
            if own >= 0:
                y = points[own]
                track.chi2 = o.fading * track.chi2 + track.nis(y)
                track.updates += 1
                track.score += hit(track.gap) + math.log(track.densities(y).sum())
                track.update(y)
                taken.add(own)
                track.last, track.last_time = y, detections.times[t]
            else:
                track.score += miss(track.gap)
            if j >= 0:
                track.gap = 0
                track.pending.append((first + j, sure[i][j]))
                if track.id < 0 and track.score >= confirm:
                    track.id = count["ids"]
                    count["ids"] += 1
                if track.id >= 0:
                    for detection, how_sure in track.pending:
                        labels[detection], confidence[detection] = track.id, how_sure
                    track.pending = []
            else:
                track.gap += 1
            agreeing = [b for b in track.branches if b.path[t] == own]
            if not agreeing or not later:
                regrow(track, later)
                continue
            for b in agreeing:
                del b.path[t], b.squares[t]
                if own >= 0:
                    b.n_taken -= 1
                    b.score += crowding(t, track.key, own)
            track.branches = agreeing
        for track in tracks:
            track.best = max(track.best, track.score)
        tracks[:] = [
            track
            for track in tracks
            if track.gap < p.max_gap
            and (track.id >= 0 or track.best - track.score <= math.log(life.delete_odds))
        ]
        for j, y in enumerate(points):
            if j in taken:
                continue
            track = Branch(model, detections.times[t], y, first + j)
            track.begin()
            track.pending = [(first + j, 1.0)]
            track.key = count["keys"]
            count["keys"] += 1
            regrow(track, later)
            tracks.append(track)

    def regrow(track: Branch, later: list[int]) -> None:
        track.branches = [root(track)]
        for n, t in enumerate(later):
            grow(t, track, n + 1)

    def claim(t: int) -> None:
        claims[t] = {}
        for track in tracks:
            if track.id < 0 or track.branches[0].has_ended or o.independent:
                continue
            b = track.branches[0].fork()
            b.predict(step_to(t))
            likelihood = b.densities(detections.frame(t)).sum(axis=1)
            seen = chance_seen(model, b.gap)
            expected = dict(enumerate((seen / s.clutter_density * likelihood).tolist()))
            expected = {j: w for j, w in expected.items() if w > math.exp(-7)}
            for j, w in expected.items():
                others = 1 - seen + sum(v for k, v in expected.items() if k != j)
                claims[t][track.key, j] = w / others

    window: list[int] = []
    for t in range(detections.n_frames):
        claim(t)
        window.append(t)
        for track in tracks:
            grow(t, track, len(window))
        if len(window) == method.window:
            decide(window.pop(0), window)
    while window:
        decide(window.pop(0), window)
    return labels, confidence


def resolve(gains, squares, method) -> dict[int, int]:
    if isinstance(method, am.TrackSplitting):
        return {i: js[0] for i, js in pair([], [], gains, am.GNN()).items()}
    n, m = gains.shape
    if method.proposers == "tracks":
        lists = [sorted(np.flatnonzero(np.isfinite(r)), key=lambda j, r=r: -r[j]) for r in gains]
        costs = {(i, j): squares[i, j] for i in range(n) for j in range(m)}
        return {i: int(j) for i, j in enumerate(propose(lists, costs)) if j >= 0}
    lists = [
        sorted(np.flatnonzero(np.isfinite(gains[:, j])), key=lambda i, j=j: (squares[i, j], i))
        for j in range(m)
    ]
    costs = {(j, i): -gains[i, j] for i in range(n) for j in range(m)}
    return {int(i): j for j, i in enumerate(propose(lists, costs)) if i >= 0}
