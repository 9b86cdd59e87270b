"""Where tracks have gaps, what is known at their ends, and where else the same could be hidden.

Symbols: L frames of a gap, n frames at its ends, W = n + L, H held-out windows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["NEAREST_ENDS", "N_ENDS", "Span", "find_gaps", "held_out", "n_apart", "usable_ends"]

N_ENDS = 10
"""Frames at each end of a gap that are looked at: enough for a slope, too few for the past."""
REACH = 2
"""They lie within so many times `N_ENDS` frames of the gap, for there may be others beside it."""
NEAREST_ENDS = 3
"""Frames on each side in which all must have been seen, or the helpers known."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """A gap of a track: its frames from `first` to `last` are missing, those around it are not."""

    track: int
    first: int
    last: int

    @property
    def length(self) -> int:
        """Number of frames L."""
        return self.last - self.first + 1

    @property
    def hidden(self) -> NDArray[np.int64]:
        """Frames of the gap, shape (L,)."""
        return np.arange(self.first, self.last + 1)


def find_gaps(seen: NDArray[np.bool_]) -> list[Span]:
    """Find every gap that has both ends, by track and then by time.

    Parameters
    ----------
    seen : ndarray of bool, shape (T, K)
        Where each track was measured.
    """
    change = np.diff(seen.T.astype(np.int8), axis=1)
    lost_track, lost = np.nonzero(change < 0)
    found_track, found = np.nonzero(change > 0)
    spans: list[Span] = []
    for track in np.unique(lost_track):
        begins, stops = lost[lost_track == track] + 1, found[found_track == track]
        # What comes before the first detection is no gap, nor what comes after the last.
        stops = stops[stops >= begins[0]]
        for first, last in zip(begins.tolist(), stops.tolist(), strict=False):
            spans.append(Span(track=int(track), first=first, last=last))
    return spans


def usable_ends(seen: NDArray[np.bool_], span: Span) -> NDArray[np.int64]:
    """Give up to `N_ENDS` frames on each side in which the track was seen, in order of time.

    Parameters
    ----------
    seen : ndarray of bool, shape (T,)
        Where the track was measured.
    span : Span
        Its gap.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    begin = max(span.first - REACH * N_ENDS, 0)
    before = begin + np.flatnonzero(seen[begin : span.first])[-N_ENDS:]
    stop = span.last + 1
    after = stop + np.flatnonzero(seen[stop : stop + REACH * N_ENDS])[:N_ENDS]
    return np.concatenate([before, after])


def held_out(
    own: NDArray[np.bool_],
    bridged: NDArray[np.bool_],
    helped: NDArray[np.bool_],
    frames: NDArray[np.int64],
    span: Span,
    most: int,
) -> NDArray[np.int64]:
    """Move the frames of a gap and its ends to where all that they need is known.

    Parameters
    ----------
    own : ndarray of bool, shape (T,)
        Where the marker was seen: needed in the `NEAREST_ENDS` frames on each side, for what is
        bridged there would know of what is hidden, and in half of what is hidden.
    bridged : ndarray of bool, shape (T,)
        Where it was seen or bridged: needed in all other frames, for a stretch of which a long part
        is not known tells little.
    helped : ndarray of bool, shape (T,)
        Where all its helpers are known: needed throughout.
    frames : ndarray of int, shape (W,)
        Frames of the gap and of its ends, in order of time.
    span : Span
        The gap.
    most : int
        Windows that are wanted at most; they are spread evenly over those there are.

    Returns
    -------
    ndarray of int, shape (H, W)
    """
    first = frames.min()
    n_starts = len(own) - int(frames.max() - first)
    if n_starts <= 0:
        return np.empty((0, len(frames)), dtype=np.int64)

    def count(mask: NDArray[np.bool_], frames: NDArray[np.int64]) -> NDArray[np.int64]:
        """Count from each start those of the frames that the mask has, a run at a time."""
        total = np.concatenate([[0], np.cumsum(mask)])
        found = np.zeros(n_starts, dtype=np.int64)
        for shift, length in _runs(frames - first):
            found += total[shift + length :][:n_starts] - total[shift:][:n_starts]
        return found

    before, after = frames[frames < span.first], frames[frames > span.last]
    nearest = np.concatenate([before[-NEAREST_ENDS:], after[:NEAREST_ENDS]])
    fits = count(helped & bridged, frames) == len(frames)
    fits &= count(own, nearest) == len(nearest)
    fits &= 2 * count(own, span.hidden) >= span.length
    starts = np.flatnonzero(fits)
    if len(starts) > most:
        starts = starts[np.linspace(0, len(starts) - 1, most).round().astype(int)]
    return starts[:, None] + (frames - first)


def _runs(shifts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Give begin and length of each unbroken run of some numbers."""
    if not len(shifts):
        return []
    ordered = np.sort(shifts)
    pieces = np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
    return [(int(piece[0]), len(piece)) for piece in pieces]


def n_apart(windows: NDArray[np.int64], length: int) -> int:
    """Count windows of which none hides a frame that another hides, greedily in time."""
    n, free = 0, -1
    for start in windows.min(axis=1, initial=np.iinfo(np.int64).max).tolist():
        if start >= free:
            n, free = n + 1, start + length
    return n
