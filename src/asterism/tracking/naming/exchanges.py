"""Stretches in which two tracks have exchanged their markers, found without any names.

Distances to steady neighbours show an exchange: those of both tracks change at the same time, each
to what the other's were before.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.naming.positions import positions_in, scattered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, Tracks

__all__ = ["without_exchanges"]

LENGTH = 600
"""Number of frames in which tracks are compared at a time, overlapping by half."""
SAMPLED = 60
"""Number of these frames in which distances are measured."""
MIN_FRAMES = 5
"""Smallest number of sampled frames of a stretch, of the rest, and of a distance in each."""
NEIGHBOURS = 8
"""Number of neighbours to which distances are measured."""
MAX_DISTANCE = 0.3
"""Largest distance of two tracks that may be exchanged, metres."""
NOISE = 0.005
"""Spread of a distance that never changes, metres."""
MIN_COMMON = 0.7
"""Smallest share of the frames with both tracks in which a neighbour exists too."""
MIN_SPREAD = 0.015
"""Spread, metres, that some distance of two tracks has if they have been exchanged."""
MIN_DECREASE = 0.3
"""Smallest gain of an exchange: the decrease of log(spread of a distance), in the mean over the
distances of both tracks. The spreads then are 0.74 of what they were."""


def without_exchanges(tracks: Tracks) -> Tracks:
    """Exchange two tracks back from where they have each other's marker.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture. Exchanges that last less than `MIN_FRAMES` of the `SAMPLED` frames
        are not found.

    Returns
    -------
    Tracks
        Tracks of the same detections.
    """
    n = tracks.detections.n_frames
    labels = tracks.labels.copy()
    for start in range(0, max(n - LENGTH // 2, 1), LENGTH // 2):
        _exchange_back(tracks.detections, labels, start, min(start + LENGTH, n))
    return tracks if np.array_equal(labels, tracks.labels) else replace(tracks, labels=labels)


def _exchange_back(d: Detections, labels: NDArray[np.int64], start: int, end: int) -> None:
    """Exchange labels in place, as the frames from `start` to `end` show."""
    chosen = np.unique(np.linspace(start, end - 1, SAMPLED).astype(np.int64))
    is_chosen = np.zeros(d.n_frames, dtype=bool)
    is_chosen[chosen] = True
    own = labels[(labels >= 0) & is_chosen[d.frame_of]]
    alive = np.flatnonzero(np.bincount(own) >= 2 * MIN_FRAMES)
    column = np.full(labels.max(initial=-1) + 2, -1)  # the last element is for clutter
    column[alive] = np.arange(len(alive))
    at = positions_in(d, chosen, column[labels], len(alive))
    for a, b, first, last in _found(at):
        pair = alive[[a, b]]
        for edge in sorted({first, last} - {0, len(chosen)}):  # each exchanges all frames after it
            around = chosen[[max(edge - 2, 0), min(edge + 1, len(chosen) - 1)]]
            rows = slice(d.offsets[_moment(d, labels, pair, *around)], None)
            own = labels[rows]
            is_one, is_other = own == pair[0], own == pair[1]
            own[is_one], own[is_other] = pair[1], pair[0]


def _moment(
    d: Detections, labels: NDArray[np.int64], pair: NDArray[np.int64], first: int, last: int
) -> int:
    """Return the frame in (first, last] from which an exchange of two tracks shortens their way."""
    rows = np.arange(*d.offsets[[first, last + 1]])
    rows = rows[np.isin(labels[rows], pair)]
    column = np.searchsorted(np.sort(pair), labels[rows])
    at = scattered(d.points[rows], d.frame_of[rows] - first, column, last - first + 1, 2)
    for t in range(1, len(at)):  # an occluded marker stays where it was
        at[t] = np.where(np.isnan(at[t]), at[t - 1], at[t])
    kept = np.linalg.norm(at[1:] - at[:-1], axis=2).sum(axis=1)
    exchanged = np.linalg.norm(at[1:] - at[:-1, ::-1], axis=2).sum(axis=1)
    return first + 1 + int(np.argmax(np.nan_to_num(kept - exchanged, nan=-np.inf)))


def _found(at: NDArray[np.float64]) -> list[tuple[int, int, int, int]]:
    """Return pairs of columns of positions (F, n, 3), with the stretch in which they changed."""
    distance = np.linalg.norm(at[:, :, None] - at[:, None], axis=3)  # (F, n, n)
    n_common = np.isfinite(distance).sum(axis=0)
    middle = np.full(n_common.shape, np.inf)
    enough = (n_common >= 2 * MIN_FRAMES) & ~np.eye(len(middle), dtype=bool)
    middle[enough] = np.nanmedian(distance[:, enough], axis=0)
    spread = np.zeros(n_common.shape)
    spread[enough] = np.nanstd(distance[:, enough], axis=0)
    found: list[tuple[float, int, int, int, int]] = []
    for a, b in zip(*np.nonzero(np.triu(middle < MAX_DISTANCE)), strict=True):
        far = np.maximum(middle[a], middle[b])
        far[np.minimum(n_common[a], n_common[b]) < MIN_COMMON * n_common[a, b]] = np.inf
        neighbours = np.argsort(far, kind="stable")[:NEIGHBOURS]
        neighbours = neighbours[np.isfinite(far[neighbours])]
        if len(neighbours) < 3 or spread[[a, b]][:, neighbours].max() < MIN_SPREAD:
            continue
        decrease, first, last = _best(distance[:, a, neighbours], distance[:, b, neighbours])
        if decrease > MIN_DECREASE:
            found.append((decrease, int(a), int(b), first, last))
    done: set[int] = set()
    result: list[tuple[int, int, int, int]] = []
    for _, a, b, first, last in sorted(found, reverse=True):
        if not done & {a, b}:
            result.append((a, b, first, last))
            done |= {a, b}
    return result


def _best(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, int, int]:
    """Return the stretch whose exchange makes two series (F, C) steadiest, with the decrease.

    The decrease is that of the log of the spreads, in the mean of both series and all columns.
    """
    both = np.isfinite(x) & np.isfinite(y)
    n = both.sum(axis=0)
    x, y = np.where(both, x, 0.0), np.where(both, y, 0.0)

    first, last = np.triu_indices(len(x) + 1, 1)
    counts = np.concatenate([np.zeros((1, len(n)), dtype=np.int64), np.cumsum(both, axis=0)])
    inside = counts[last] - counts[first]
    is_long = np.minimum(inside, n - inside).min(axis=1) >= MIN_FRAMES
    if not is_long.any():
        return -np.inf, 0, 0
    first, last = first[is_long], last[is_long]

    def within(values: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        return sums[last] - sums[first]  # of each stretch, and column

    def variance(s: NDArray[np.float64], squares: NDArray[np.float64]) -> NDArray[np.float64]:
        mean = s / n
        return np.maximum(squares / n - mean * mean, 0) + NOISE**2

    move, move2 = within(y - x), within(y**2 - x**2)
    sx, sy, sx2, sy2 = x.sum(axis=0), y.sum(axis=0), (x**2).sum(axis=0), (y**2).sum(axis=0)
    before = variance(sx, sx2) * variance(sy, sy2)
    after = variance(sx + move, sx2 + move2) * variance(sy - move, sy2 - move2)
    gain = 0.25 * (np.log(before).mean() - np.log(after).mean(axis=1))
    best = int(np.argmax(gain))
    return float(gain[best]), int(first[best]), int(last[best])
