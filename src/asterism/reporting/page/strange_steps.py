"""Improbable steps of tracks: jumps, and apparent swaps of two tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.reporting.page.nearest import usual_distance

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["StrangeStep", "strange_steps"]

USUAL = 12.0
"""Least prediction error of an improbable step, relative to the median of its track."""
LEAST = 0.25
"""Least prediction error of an improbable step, relative to the distance between neighbours."""
MOST = 2000
"""Number of largest improbable steps that are examined, because a list has no room for more."""


class StrangeStep(NamedTuple):
    """Detection far from the linear prediction of its track.

    Attributes
    ----------
    detection : int
        Index of the detection.
    other : int
        Track that probably swapped its label with this one, -1 for none.
    off : float
        Distance from the prediction, metres.
    ratio : float
        This distance divided by the median of the track.
    """

    detection: int
    other: int
    off: float
    ratio: float


def strange_steps(tracks: Tracks) -> Iterator[StrangeStep]:
    """Find detections far from the linear extrapolation of the two before them.

    Two tracks have probably swapped in a frame if each is nearer to the prediction of the other,
    and the swap halves the sum of both distances at least.

    Parameters
    ----------
    tracks : Tracks
        Tracks in 2-D or 3-D; only runs without a gap are examined.

    Yields
    ------
    StrangeStep
        The largest distance first. A swap is yielded once, for the track with the larger distance.
    """
    heading, off = _headings(tracks)
    usual = _medians(tracks, off)
    least = LEAST * usual_distance(tracks)
    ratio = off / np.maximum(usual, 1e-5)
    is_strange = (ratio > USUAL) & (off > least)
    strange = np.flatnonzero(is_strange)
    strange = strange[np.argsort(-off[strange], kind="stable")][:MOST]
    explained: set[int] = set()
    for i in strange:
        if int(i) in explained:
            continue
        j = _partner(tracks, heading, off, int(i))
        other = -1
        if j >= 0:
            # The predictions of the next two steps include the swap, so they are improbable too.
            explained |= {int(i), j}
            other = int(tracks.labels[j])
        elif _follows_a_strange_one(tracks, is_strange, int(i)):
            continue
        yield StrangeStep(int(i), other, float(off[i]), float(ratio[i]))


def _headings(tracks: Tracks) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return predictions, shape (N, D), and distances from them, (N,); NaN if not known."""
    d = tracks.detections
    order, _ = tracks.by_track
    heading = np.full(d.points.shape, np.nan)
    if len(order) > 2:
        track, frame = tracks.labels[order], d.frame_of[order]
        follows = (track[2:] == track[:-2]) & (frame[2:] - frame[:-2] == 2)
        before, last, now = (order[s][follows] for s in (slice(-2), slice(1, -1), slice(2, None)))
        t = d.times[d.frame_of]
        pace = ((t[now] - t[last]) / (t[last] - t[before]))[:, None]
        heading[now] = d.points[last] + pace * (d.points[last] - d.points[before])
    return heading, np.linalg.norm(d.points - heading, axis=1)


def _medians(tracks: Tracks, off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median distance of each detection's track, shape (N,)."""
    order, starts = tracks.by_track
    usual = np.full(len(off), np.inf)
    for k in range(tracks.n_tracks):
        members = order[starts[k] : starts[k + 1]]
        known = off[members][np.isfinite(off[members])]
        usual[members] = np.median(known) if len(known) >= 5 else np.inf
    return usual


def _partner(tracks: Tracks, heading: NDArray[np.float64], off: NDArray[np.float64], i: int) -> int:
    """Return the detection of the frame that probably swapped its label with this one, or -1."""
    d = tracks.detections
    t = int(d.frame_of[i])
    others = np.arange(d.offsets[t], d.offsets[t + 1])
    others = others[(tracks.labels[others] >= 0) & np.isfinite(off[others]) & (others != i)]
    if not len(others):
        return -1
    crossed = np.linalg.norm(d.points[i] - heading[others], axis=1)
    crossed += np.linalg.norm(d.points[others] - heading[i], axis=1)
    share = crossed / (off[i] + off[others])
    best = int(np.argmin(share))
    return int(others[best]) if share[best] < 0.5 else -1


def _follows_a_strange_one(tracks: Tracks, is_strange: NDArray[np.bool_], i: int) -> bool:
    """Return whether one of the two previous steps was as improbable; a jump causes both."""
    order, starts = tracks.by_track
    k = tracks.labels[i]
    place = starts[k] + np.searchsorted(order[starts[k] : starts[k + 1]], i)
    before = order[max(starts[k], place - 2) : place]
    return bool(is_strange[before].any())
