"""Exchanges of the later parts of two tracks: every pair in every frame, without screening."""

from __future__ import annotations

import functools
import itertools
from typing import TYPE_CHECKING

import numpy as np

from tests.references.filters import imm_log_densities

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import TrackingModel

HEAD, TAIL, NEAR, MIN_GAIN = 6, 4, 10, -4.0
FAR, TIMES = 100, 4


class Compared:
    """Whether an exchange is of four parts, whether all deviations are within reach, its gain."""

    def __init__(self, is_mutual: bool, is_near: bool, compute_gain: Callable[[], float]) -> None:
        self.is_mutual, self.is_near, self._compute_gain = is_mutual, is_near, compute_gain

    @functools.cached_property
    def gain(self) -> float:
        """Log-likelihood ratio, computed at first use: most exchanges are far out of reach."""
        return self._compute_gain()


def every_exchange(
    model: TrackingModel, times, tracks, p_detection: float
) -> dict[tuple[int, int, int], Compared]:
    """Compare all pairs of tracks, each given as (frames, points), at every frame.

    Returns the comparisons by frame and tracks.
    """

    @functools.cache  # several frames and pairs compare the same link
    def link(head: int, n_head: int, tail: int, n_before: int) -> float:
        (frames, points), (later, ends) = tracks[head], tracks[tail]
        return _log_likelihood(
            model, times, (frames[:n_head], points[:n_head]), (later[n_before:], ends[n_before:]),
            np.log1p(-p_detection),
        )  # fmt: skip

    found: dict[tuple[int, int, int], Compared] = {}
    for t in range(len(times)):
        is_open = [
            len(frames) > 0 and frames[0] - NEAR <= t <= frames[-1] + NEAR for frames, _ in tracks
        ]
        for a, b in itertools.combinations(np.flatnonzero(is_open).tolist(), 2):
            one = _compare(model, times, t, tracks, a, b, link)
            if one is not None:
                found[t, a, b] = one
    return found


def _compare(model, times, t, tracks, a, b, link):
    (head_a, tail_a), (head_b, tail_b) = _cut(tracks[a], t), _cut(tracks[b], t)
    has = [len(each[0]) > 0 for each in (head_a, tail_a, head_b, tail_b)]
    arrive_a, arrive_b = (has_tail and tail[0][0] == t for has_tail, tail in
                          ((has[1], tail_a), (has[3], tail_b)))  # fmt: skip
    if sum(has) < 3 or not (arrive_a or arrive_b):
        return None
    heads, tails = {a: head_a, b: head_b}, {a: tail_a, b: tail_b}

    def total(pairs):
        return sum(
            link(i, len(heads[i][0]), j, len(heads[j][0]))
            for i, j in pairs
            if len(heads[i][0]) and len(tails[j][0])
        )

    near = [
        _deviation(heads[i], tails[j]) <= _reach(model, times, t, heads[i], tails[i])
        for i, j in ((a, b), (b, a))
        if len(heads[i][0]) and len(tails[j][0])
    ]
    return Compared(all(has), all(near), lambda: total([(a, b), (b, a)]) - total([(a, a), (b, b)]))


def exchange_ratio(model, times, t, a, b, log_miss):
    """Return the log-likelihood ratio of an exchange of the tails of two tracks at a frame."""
    (head_a, tail_a), (head_b, tail_b) = _cut(a, t), _cut(b, t)
    pairs = [(head_a, tail_b, 1), (head_b, tail_a, 1), (head_a, tail_a, -1), (head_b, tail_b, -1)]
    return sum(
        sign * _log_likelihood(model, times, head, tail, log_miss) for head, tail, sign in pairs
    )


def _cut(track, t):
    frames, points = track
    n = int((frames < t).sum())
    return (frames[:n], points[:n]), (frames[n:], points[n:])


def _log_likelihood(model, times, head, tail, log_miss):
    frames, points = (
        np.concatenate([before[-HEAD:], after[:TAIL]])
        for before, after in zip(head, tail, strict=True)
    )
    n = min(len(head[0]), HEAD)
    return imm_log_densities(model, times, frames, points)[n:].sum() + log_miss * (
        frames[n] - frames[n - 1] - 1
    )


def _deviation(head, tail):
    """Return the squared distance of a tail from the straight motion of a head."""
    frames, points = head
    velocity = 0.0
    if len(frames) > 1:
        velocity = (points[-1] - points[-2]) / (frames[-1] - frames[-2])
    return ((tail[1][0] - points[-1] - (tail[0][0] - frames[-1]) * velocity) ** 2).sum()


def _reach(model, times, t, head, own):
    """Return the largest deviation of another tail; a far own tail enlarges it."""
    modes = model.motion.modes
    step = times[t] - times[t - 1]
    noise = modes[len(modes) // 2].process_noise(step)[0][0, 0]
    own_deviation = _deviation(head, own) if len(own[0]) else 0.0
    return max(FAR * (6 * model.sensor.noise_sigma**2 + noise), TIMES * own_deviation)
