"""Steps that a track should not make: jumps, and two tracks that seem to change places."""

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
"""A step is strange that is off by more than so many times the median of its track …"""
LEAST = 0.25
"""… and by more than so many times the usual distance of a point from its nearest neighbour."""
MOST = 2000
"""Strange steps that are looked at, the largest first; a capture with more is beyond a list."""


class StrangeStep(NamedTuple):
    """A detection that is far from where its track was heading.

    Attributes
    ----------
    detection : int
        The detection.
    other : int
        The track that seems to have changed places with its own, -1 for none.
    off : float
        Distance from where the track was heading, metres.
    ratio : float
        How many times what is usual for the track.
    """

    detection: int
    other: int
    off: float
    ratio: float


def strange_steps(tracks: Tracks) -> Iterator[StrangeStep]:
    """Find detections far from where the two before them lead.

    Two tracks seem to have changed places in a frame if each is nearer to where the other was
    heading, both together by half at least.

    Parameters
    ----------
    tracks : Tracks
        2-D or 3-D; only stretches without a gap are judged.

    Yields
    ------
    StrangeStep
        The farthest first; a change of places once, in the track that is farther off.
    """
    heading, off = _headings(tracks)
    usual = _medians(tracks, off)
    least = LEAST * usual_distance(tracks)
    ratio = off / np.maximum(usual, 1e-5)
    strange = np.flatnonzero((ratio > USUAL) & (off > least))
    strange = strange[np.argsort(-off[strange], kind="stable")][:MOST]
    explained: set[int] = set()
    for i in strange:
        if int(i) in explained:
            continue
        j = _partner(tracks, heading, off, int(i))
        other = -1
        if j >= 0:
            # What comes after a change of places is strange twice more: the way back to a line.
            explained |= {int(i), j}
            other = int(tracks.labels[j])
        elif _follows_a_strange_one(tracks, (ratio > USUAL) & (off > least), int(i)):
            continue
        yield StrangeStep(int(i), other, float(off[i]), float(ratio[i]))


def _headings(tracks: Tracks) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where tracks were heading, (N, D), and how far off they are, (N,); NaN where unknown."""
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
    """Median of what a track is usually off, for each of its detections, shape (N,)."""
    order, starts = tracks.by_track
    usual = np.full(len(off), np.inf)
    for k in range(tracks.n_tracks):
        members = order[starts[k] : starts[k + 1]]
        known = off[members][np.isfinite(off[members])]
        usual[members] = np.median(known) if len(known) >= 5 else np.inf
    return usual


def _partner(tracks: Tracks, heading: NDArray[np.float64], off: NDArray[np.float64], i: int) -> int:
    """Return the detection of the frame that has exchanged labels with this one, or -1."""
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
    """Whether one of the two steps before was as strange: a jump bends the two after it too."""
    order, starts = tracks.by_track
    k = tracks.labels[i]
    place = starts[k] + np.searchsorted(order[starts[k] : starts[k + 1]], i)
    before = order[max(starts[k], place - 2) : place]
    return bool(is_strange[before].any())
