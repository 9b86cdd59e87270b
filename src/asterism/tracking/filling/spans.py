"""Gaps of tracks, the frames at their ends, and held-out windows of the same length.

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
"""Number of frames used at each end of a gap: enough for a slope, few enough to be local."""
REACH = 2
"""Largest distance of these frames from the gap, in multiples of `N_ENDS` frames; other gaps
may lie in between."""
NEAREST_ENDS = 3
"""Number of frames on each side in which the marker must be detected and its helpers known."""


@dataclass(frozen=True, kw_only=True)
class Span:
    """Gap of a track.

    Parameters
    ----------
    track : int
        Number of the track.
    first, last : int
        First and last missing frame; the track has a detection before and after them.
    """

    track: int
    first: int
    last: int

    @property
    def length(self) -> int:
        """Number of frames L."""
        return self.last - self.first + 1

    @property
    def frames(self) -> NDArray[np.int64]:
        """Frames of the gap, shape (L,)."""
        return np.arange(self.first, self.last + 1)


def find_gaps(seen: NDArray[np.bool_]) -> list[Span]:
    """Find every gap with a detection at both ends, by track and then by time.

    Parameters
    ----------
    seen : ndarray of bool, shape (T, K)
        True where each track was measured.

    Returns
    -------
    list of Span
    """
    change = np.diff(seen.T.astype(np.int8), axis=1)
    lost_track, lost = np.nonzero(change < 0)
    found_track, found = np.nonzero(change > 0)
    spans: list[Span] = []
    for track in np.unique(lost_track):
        begins, stops = lost[lost_track == track] + 1, found[found_track == track]
        # Frames before the first and after the last detection are not gaps.
        stops = stops[stops >= begins[0]]
        for first, last in zip(begins.tolist(), stops.tolist(), strict=False):
            spans.append(Span(track=int(track), first=first, last=last))
    return spans


def usable_ends(seen: NDArray[np.bool_], span: Span) -> NDArray[np.int64]:
    """Return up to `N_ENDS` frames on each side in which the track was detected, by time.

    Parameters
    ----------
    seen : ndarray of bool, shape (T,)
        True where the track was measured.
    span : Span
        Gap of the track.

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
    smoothed: NDArray[np.bool_],
    helped: NDArray[np.bool_],
    frames: NDArray[np.int64],
    span: Span,
    max_windows: int,
) -> NDArray[np.int64]:
    """Find windows, shifted copies of a gap and its ends, in which marker and helpers are known.

    Parameters
    ----------
    own : ndarray of bool, shape (T,)
        True where the marker was detected. Required in the `NEAREST_ENDS` frames on each side,
        because smoothed positions there depend on withheld ones, and in half of the withheld
        frames.
    smoothed : ndarray of bool, shape (T,)
        True where the marker was detected or smoothed. Required in all other frames.
    helped : ndarray of bool, shape (T,)
        True where all helpers are known. Required in all frames.
    frames : ndarray of int, shape (W,)
        Frames of the gap and of its ends, in order of time.
    span : Span
        Gap to imitate.
    max_windows : int
        Largest number of windows; they are spread evenly over the possible ones.

    Returns
    -------
    ndarray of int, shape (H, W)
    """
    first = frames.min()
    n_starts = len(own) - int(frames.max() - first)
    if n_starts <= 0:
        return np.empty((0, len(frames)), dtype=np.int64)

    def count(mask: NDArray[np.bool_], frames: NDArray[np.int64]) -> NDArray[np.int64]:
        """Count the frames within the mask for each shift, one run of frames at a time."""
        total = np.concatenate([[0], np.cumsum(mask)])
        found = np.zeros(n_starts, dtype=np.int64)
        for shift, length in _runs(frames - first):
            found += total[shift + length :][:n_starts] - total[shift:][:n_starts]
        return found

    before, after = frames[frames < span.first], frames[frames > span.last]
    nearest = np.concatenate([before[-NEAREST_ENDS:], after[:NEAREST_ENDS]])
    fits = count(helped & smoothed, frames) == len(frames)
    fits &= count(own, nearest) == len(nearest)
    fits &= 2 * count(own, span.frames) >= span.length
    starts = np.flatnonzero(fits)
    if len(starts) > max_windows:
        starts = starts[np.linspace(0, len(starts) - 1, max_windows).round().astype(int)]
    return starts[:, None] + (frames - first)


def _runs(shifts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return start and length of each run of consecutive numbers."""
    if not len(shifts):
        return []
    ordered = np.sort(shifts)
    pieces = np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
    return [(int(piece[0]), len(piece)) for piece in pieces]


def n_apart(windows: NDArray[np.int64], length: int) -> int:
    """Count windows without a common withheld frame, greedily in order of time.

    Parameters
    ----------
    windows : ndarray of int, shape (H, W)
        Frames of the windows.
    length : int
        Number of withheld frames of a window.

    Returns
    -------
    int
    """
    n, free = 0, -1
    for start in windows.min(axis=1, initial=np.iinfo(np.int64).max).tolist():
        if start >= free:
            n, free = n + 1, start + length
    return n
