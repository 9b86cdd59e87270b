"""Tracks of one marker that stitching did not join, found by the distances that both keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.rigidity.profiles import learn_profiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["AGREEMENT", "agreeing"]

AGREEMENT = 2.0
"""Smallest log density ratio of one marker against two, in the mean of the steadiest distances. Of
simulated tracks above it, 20 of 21 were of one marker; of those from 1 to 2, none of four."""
MARGIN = 1.0
"""Smallest difference to the ratio of every other pair with one of both tracks."""
MAX_PAIRS = 10_000
"""Number of pairs above which none is compared: so many tracks are fragments, not markers."""


def agreeing(
    tracks: Tracks, noise_sigma: float, max_occlusion: int | None = None
) -> list[tuple[int, int]]:
    """Find pairs of tracks of one marker: they are in no frame together, and keep equal distances.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture, without names.
    noise_sigma : float
        Standard deviation of a coordinate, metres.
    max_occlusion : int, optional
        Longest time from the end of the earlier to the start of the later track, frames.

    Returns
    -------
    list of (int, int)
        The track that begins first and the other of each pair, each track at most once.
    """
    pairs = _in_turn(tracks, max_occlusion)
    if not len(pairs):
        return []
    profiles = learn_profiles(tracks.detections, tracks.labels, noise_sigma)
    ratio = profiles.engine.agreements(pairs)
    found: list[tuple[int, int]] = []
    for i in np.argsort(-ratio, kind="stable"):
        if ratio[i] < AGREEMENT:
            break
        shares = (pairs == pairs[i]).any(axis=1)
        shares[i] = False
        is_clear = ratio[i] - ratio[shares].max(initial=-np.inf) >= MARGIN
        # A track may continue one and be continued by another, which are in some frame together.
        if is_clear and not np.isin(pairs[i], found).any():
            found.append((int(pairs[i, 0]), int(pairs[i, 1])))
    return found


def _in_turn(tracks: Tracks, max_occlusion: int | None) -> NDArray[np.int64]:
    """Return all pairs of tracks that take turns and are in no frame together, (n, 2)."""
    order, offsets = tracks.by_track
    used = np.flatnonzero(tracks.lengths)
    frames = tracks.detections.frame_of[order]
    first, last = frames[offsets[used]], frames[offsets[used + 1] - 1]
    begins_first = (first[:, None] < first[None]) | np.triu(first[:, None] == first[None], 1)
    begin, end = np.minimum(first[:, None], first[None]), np.maximum(last[:, None], last[None])
    lengths = tracks.lengths[used]
    may_be_one = begins_first & (lengths[:, None] + lengths[None] <= end - begin + 1)
    if max_occlusion is not None:
        may_be_one &= first[None] - last[:, None] - 1 <= max_occlusion
    before, after = np.nonzero(may_be_one)
    if len(before) > MAX_PAIRS:
        return np.empty((0, 2), dtype=np.int64)
    of = [frames[offsets[k] : offsets[k + 1]] for k in used]

    def are_apart(a: int, b: int) -> bool:
        low, high = first[b], min(last[a], last[b])
        one, other = (f[slice(*np.searchsorted(f, [low, high + 1]))] for f in (of[a], of[b]))
        return len(one) + len(other) <= high - low + 1 and not np.isin(one, other).any()

    is_apart = [
        last[a] < first[b] or are_apart(a, b)
        for a, b in zip(before.tolist(), after.tolist(), strict=True)
    ]
    return np.stack([used[before[is_apart]], used[after[is_apart]]], axis=1).astype(np.int64)
