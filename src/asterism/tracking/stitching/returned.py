"""Bodies that left the view and came back, found by the distances among their markers."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["returned"]

Pair = tuple[int, int]
"""An earlier and a later track, of the pairs that are kept where many agree."""
MANY = 50_000
"""Number of agreements above which only supported pairs are kept."""

MIN_FRAMES = 10
"""Smallest number of frames of a distance."""
SAMPLES = 240
"""Number of frames in which a distance is measured."""
MIN_NOISE = 1e-3
"""Smallest standard deviation of a coordinate, metres."""
BEND = 0.01
"""Spread of a distance as a share of it."""
STEADY = (0.012, 0.025)
"""Largest spreads of a distance that is compared, metres: within segments, then between them."""
SUPPORTED = 0.5
"""Smallest sum of the log density ratios of a pair, relative to the best pair of its later
track."""
UNKNOWN = 0.1
"""Spread of the distances of other markers about any distance, metres."""
ALIKE = 1.0
"""Smallest log density ratio of two distances of one pair of markers against two pairs."""
ENOUGH = 6.0
"""Smallest log odds of a body: three markers at distances with a spread of a centimetre."""
LEAD = 3.0
"""Smallest difference of the log odds to those of every body that excludes it."""
MAX_PAIRS = 10_000
"""Number of distances above which none is measured: so many tracks are fragments."""


class _Steady(NamedTuple):
    """Steady distances between tracks that are seen together.

    Parameters
    ----------
    tracks : ndarray of int, shape (P, 2)
    median, spread : ndarray of shape (P,)
        Metres.
    """

    tracks: NDArray[np.int64]
    median: NDArray[np.float64]
    spread: NDArray[np.float64]


def returned(
    tracks: Tracks,
    noise_sigma: float,
    max_occlusion: int | None = None,
    *,
    steady: float = STEADY[0],
) -> list[tuple[int, int]]:
    """Find tracks that continue earlier ones as a body.

    Three or more tracks continue as many earlier ones if the steady distances among them are those
    among the earlier ones, and no other assignment explains the same tracks nearly as well.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture, without names.
    noise_sigma : float
        Standard deviation of a coordinate, metres.
    max_occlusion : int, optional
        Longest time from the end of the earlier to the start of the later track, frames.
    steady : float
        Largest spread of a distance that is compared, metres.

    Returns
    -------
    list of (int, int)
        The first track of a marker and a later one, for each later one.
    """
    order, offsets = tracks.by_track
    frames = tracks.detections.frame_of[order]
    if not len(frames):
        return []
    first, last = frames[np.minimum(offsets[:-1], len(frames) - 1)], frames[offsets[1:] - 1]
    is_long = tracks.lengths >= MIN_FRAMES
    follows = is_long[:, None] & is_long & (last[:, None] < first)
    if max_occlusion is not None:
        follows &= first - last[:, None] - 1 <= max_occlusion
    if min(follows.any(axis=1).sum(), follows.any(axis=0).sum()) < 3:
        return []
    alike = _alike(_steady(tracks, first, last, follows, noise_sigma, steady), follows)
    bodies = _bodies(_supported(alike))
    markers = [sorted(own, key=lambda k: first[k]) for own in _clear(bodies, follows | follows.T)]
    return sorted((own[0], later) for own in markers for later in own[1:])


def _steady(
    tracks: Tracks,
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    follows: NDArray[np.bool_],
    noise_sigma: float,
    steady: float,
) -> _Steady:
    """Measure the distances of tracks that may be continued, or continue others."""
    order, _ = tracks.by_track
    d = tracks.detections
    key = tracks.labels[order] * d.n_frames + d.frame_of[order]
    used = np.flatnonzero(follows.any(axis=0) | follows.any(axis=1))
    first, last = first[used], last[used]
    low, high = np.maximum(first[:, None], first), np.minimum(last[:, None], last)
    a, b = np.nonzero(np.triu(high - low + 1 >= MIN_FRAMES, 1))
    if len(a) > MAX_PAIRS:
        a = b = a[:0]
    low, high, a, b = low[a, b], high[a, b], used[a], used[b]
    at = low[:, None] + np.arange(SAMPLES) * (high - low + 1)[:, None] // SAMPLES
    seen, rows = np.diff(at, axis=1, prepend=-1) > 0, []
    for k in (a, b):
        wanted = k[:, None] * d.n_frames + at
        found = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        seen &= key[found] == wanted
        rows.append(order[found])
    distance = np.linalg.norm(d.points[rows[0]] - d.points[rows[1]], axis=2)
    median = _median(distance, seen)
    spread = 1.4826 * _median(np.abs(distance - median[:, None]), seen)
    floor = 2 * max(noise_sigma, MIN_NOISE) ** 2 + (BEND * median) ** 2
    spread = np.sqrt(spread**2 + floor)
    is_steady = (seen.sum(axis=1) >= MIN_FRAMES) & (spread < steady)
    return _Steady(np.stack([a, b], axis=1)[is_steady], median[is_steady], spread[is_steady])


def _median(values: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the median of the seen values of each row."""
    ranked = np.sort(np.where(seen, values, np.inf), axis=1)
    return np.take_along_axis(ranked, seen.sum(axis=1)[:, None] // 2, axis=1)[:, 0]


def _alike(steady: _Steady, follows: NDArray[np.bool_]) -> dict[Pair, dict[Pair, float]]:
    """Compare all steady distances of earlier with those of later tracks.

    Returns
    -------
    dict
        For two pairs of an earlier and a later track, the log density ratio of the distances of the
        earlier and of the later tracks being one, where it exceeds `ALIKE`.
    """
    found: dict[Pair, dict[Pair, float]] = {}
    later = np.concatenate([steady.tracks, steady.tracks[:, ::-1]])
    medians, spreads = np.tile(steady.median, 2), np.tile(steady.spread, 2)
    for (a, b), median, spread in zip(*(each.tolist() for each in steady), strict=True):
        at = np.flatnonzero(follows[a, later[:, 0]] & follows[b, later[:, 1]])
        off, both = median - medians[at], np.hypot(spread, spreads[at])
        ratio = _log_t(off, both) - _log_t(off, np.hypot(both, UNKNOWN))
        for k in np.flatnonzero(ratio > ALIKE):
            one, other = (a, int(later[at[k], 0])), (b, int(later[at[k], 1]))
            found.setdefault(one, {})[other] = found.setdefault(other, {})[one] = float(ratio[k])
    return found


def _log_t(off: NDArray[np.float64], spread: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log density of Student's t with three degrees of freedom, but for a constant."""
    return -2 * np.log1p(off * off / (3 * spread * spread)) - np.log(spread)


def _supported(alike: dict[Pair, dict[Pair, float]]) -> dict[Pair, dict[Pair, float]]:
    """Leave out the pairs that agree with far fewer others than another of their later track."""
    if sum(map(len, alike.values())) < 2 * MANY:
        return alike
    support: dict[Pair, float] = {}
    best: dict[int, float] = {}
    for pair, others in alike.items():
        by_track: dict[int, float] = {}
        for (track, _), ratio in others.items():
            by_track[track] = max(by_track.get(track, 0.0), ratio)
        support[pair] = sum(by_track.values())
        best[pair[1]] = max(best.get(pair[1], 0.0), support[pair])
    kept = {pair for pair, sum_ in support.items() if sum_ >= SUPPORTED * best[pair[1]]}
    return {
        pair: {other: ratio for other, ratio in others.items() if other in kept}
        for pair, others in alike.items()
        if pair in kept
    }


def _bodies(alike: dict[Pair, dict[Pair, float]]) -> dict[tuple[Pair, ...], float]:
    """Return sets of pairs whose distances all agree, with their log odds.

    Each begins with three pairs and takes the one that agrees best until there is none.
    """
    found: dict[tuple[Pair, ...], float] = {}
    for body in _threes(alike):
        total = sum(alike[one][other] for one, other in combinations(body, 2))
        one, two, three = (alike[pair] for pair in body)
        gains = {
            pair: one[pair] + two[pair] + three[pair]
            for pair in one.keys() & two.keys() & three.keys()
        }
        while gains:
            best = max(gains, key=lambda pair: (gains[pair], pair))
            total += gains[best]
            body.append(best)
            agrees = alike[best]
            gains = {pair: gain + agrees[pair] for pair, gain in gains.items() if pair in agrees}
        n = len(body)
        # The distances of n markers of a body are known from 3 n - 6 of them.
        found[tuple(sorted(body))] = (3 * n - 6) * total / (n * (n - 1) / 2)
    return found


def _threes(alike: dict[Pair, dict[Pair, float]]) -> Iterator[list[Pair]]:
    for one, others in alike.items():
        for two, three in combinations((each for each in others if each > one), 2):
            if three in alike[two]:
                yield [one, two, three]


def _clear(bodies: dict[tuple[Pair, ...], float], may_be_one: NDArray[np.bool_]) -> list[list[int]]:
    """Return the tracks of each marker, by the bodies that no other body contradicts."""
    ranked = sorted(bodies.items(), key=lambda each: (-each[1], each[0]))
    left = dict(ranked)  # those that no clear body excludes
    marker: dict[int, list[int]] = {}
    for body, log_odds in ranked:
        if log_odds < ENOUGH:
            break
        if body not in left or any(
            odds > log_odds - LEAD and _exclude(body, each, may_be_one)
            for each, odds in left.items()
        ):
            continue
        both = [(marker.get(a, [a]), marker.get(b, [b])) for a, b in body]
        if all(one is other or may_be_one[np.ix_(one, other)].all() for one, other in both):
            left = {k: odds for k, odds in left.items() if not _exclude(body, k, may_be_one)}
            for one, other in both:
                if one is not other:
                    marker.update(dict.fromkeys(one + other, one + other))
    return list({id(each): each for each in marker.values()}.values())


def _exclude(
    body: tuple[Pair, ...], other: tuple[Pair, ...], may_be_one: NDArray[np.bool_]
) -> bool:
    """Return whether two bodies cannot both be right.

    They give one track two markers, or two tracks of one time one marker.
    """
    later, earlier = dict(body), {b: a for a, b in body}
    return any(
        (b in earlier and earlier[b] != a and not may_be_one[a, earlier[b]])
        or (a in later and later[a] != b and not may_be_one[b, later[a]])
        for a, b in other
    )
