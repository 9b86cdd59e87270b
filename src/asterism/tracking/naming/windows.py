"""Names for all tracks of a capture, window by window, from the names of some.

Windows are named outwards from the frame of the first names, then again, in order of time, with the
subject as measured in all of them. A track keeps its name from window to window, unless all of its
windows together favour another one, or a single one does so by far.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.tracking.naming.evidence import prior_of
from asterism.tracking.naming.own_names import own_log_odds
from asterism.tracking.naming.positions import positions_in, scattered
from asterism.tracking.naming.subject import Subject
from asterism.tracking.rigidity.distances import distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, MarkerSet

__all__ = ["WindowNames", "Windows", "most_of_each"]

LENGTH = 15
"""Length of a window, frames."""
SAMPLED = 5
"""Number of frames of a window in which distances are measured."""
BONUS = 8.0
"""Log odds in each window for the name that a track has had."""
FULL_BONUS = 5
"""Number of detections in a window from which on the whole bonus counts."""
MIN_LOG_ODDS = 6.0
"""Log odds of a name below which a track has none in a window."""
MIN_GAIN = 2.0
"""Log odds by which all windows of two tracks must favour the exchange of their names."""
SWEEPS = 4
"""Number of times that all windows are named."""
SUBJECT_FRAMES = 150
"""Number of frames in which the subject is measured."""
ROUNDS = 3
"""Largest number of times that a window is named with the names of the time before."""
TAKEN = -99.0


@dataclass(eq=False)
class Windows:
    """Detections of a capture, with the track of each, cut into windows."""

    detections: Detections
    tracks: NDArray[np.int64]  # (N,), -1 for clutter
    edges: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        n = self.detections.n_frames
        self.edges = np.append(np.arange(0, max(n - LENGTH // 2, 1), LENGTH), n)

    def __len__(self) -> int:
        return len(self.edges) - 1

    def holding(self, frame: int) -> int:
        """Return the window of a frame."""
        return int(np.searchsorted(self.edges, frame, side="right")) - 1

    def rows(self, w: int) -> NDArray[np.int64]:
        """Return the detections of a window that belong to a track."""
        first, end = self.detections.offsets[self.edges[[w, w + 1]]]
        return first + np.flatnonzero(self.tracks[first:end] >= 0)

    def dense(
        self, w: int, rows: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the tracks in a window, and their positions of shape (frames, A, 3)."""
        alive, column = np.unique(self.tracks[rows], return_inverse=True)
        frame = self.detections.frame_of[rows] - self.edges[w]
        return alive, scattered(
            self.detections.points[rows], frame, column, int(np.diff(self.edges)[w]), len(alive)
        )


def most_of_each(
    tracks: NDArray[np.int64], values: NDArray[np.int64], n_tracks: int
) -> NDArray[np.int64]:
    """Return the value, -1 or above, that most detections of each track have, (K,)."""
    used = np.flatnonzero(tracks >= 0)
    width = int(values.max(initial=-1)) + 2
    cells, counts = np.unique(tracks[used] * width + values[used] + 1, return_counts=True)
    most = np.full(n_tracks, -1)
    order = np.argsort(counts, kind="stable")  # the largest count is written last
    most[cells[order] // width] = cells[order] % width - 1
    return most


@dataclass(eq=False, kw_only=True)
class WindowNames:
    """Names of the tracks in each window.

    Parameters
    ----------
    windows : Windows
        Capture.
    made : MarkerSet
        Markers.
    size : float
        Size of the subject relative to the set.
    is_kept : bool
        Whether the markers are where they were when the set was learnt.
    track_markers : ndarray of int, shape (K,)
        Marker of each track in the capture as a whole, -1 for none so far.
    refused : ndarray of bool, shape (K, M)
        Names that a track cannot have.
    given : ndarray of int, shape (N,)
        Marker of each detection by the names that the capture has itself, -1 for none.
    """

    windows: Windows
    made: MarkerSet
    size: float
    is_kept: bool
    track_markers: NDArray[np.int64]
    refused: NDArray[np.bool_]
    given: NDArray[np.int64]
    markers: NDArray[np.int64] = field(init=False)  # (N,), of each detection
    evidence: NDArray[np.float64] = field(init=False)  # (K, M), sum over the windows
    exchanges: NDArray[np.float64] = field(init=False)  # (K, M), gain of another name, all windows
    without: NDArray[np.float64] = field(init=False)  # (K,), gain of no name, all windows
    counts: NDArray[np.int64] = field(init=False)  # (K,), windows of each track

    def __post_init__(self) -> None:
        tracks = self.windows.tracks
        self.markers = np.where(tracks >= 0, np.append(self.track_markers, -1)[tracks], -1)

    def sweep(self, first: int) -> None:
        """Name all windows, outwards from window `first`, then in order of time until stable."""
        order = sorted(range(len(self.windows)), key=lambda w: abs(w - first))
        K, M = len(self.track_markers), len(self.made)
        for n in range(SWEEPS):
            before = self.markers.copy()
            measured = distances_between(self.positions(SUBJECT_FRAMES))
            subject = Subject.of(self.made, self.size, measured, is_kept=self.is_kept)
            self.evidence, self.exchanges = np.zeros((K, M)), np.zeros((K, M))
            self.without, self.counts = np.zeros(K), np.zeros(K, dtype=np.int64)
            for w in order:
                self._name(w, subject)
            order = list(range(len(self.windows)))
            self._decide()
            if n > 0 and np.array_equal(before, self.markers):
                break

    def usual(self) -> NDArray[np.int64]:
        """Return the marker that each track has in most of its detections, (K,), -1 for none."""
        return most_of_each(self.windows.tracks, self.markers, len(self.track_markers))

    def positions(self, n_frames: int) -> NDArray[np.float64]:
        """Return the positions of the markers in frames spread over the capture, (F, M, 3)."""
        d = self.windows.detections
        frames = np.unique(np.linspace(0, d.n_frames - 1, n_frames).astype(np.int64))
        return positions_in(d, frames, self.markers, len(self.made))

    def renamed(self, marker_of: NDArray[np.int64], refused: NDArray[np.bool_]) -> None:
        """Replace each marker by another, -1 for none: the result of a search over markers.

        The tracks of a marker are refused other ones by the rows of `refused`, (M, M).
        """
        of = np.append(marker_of, -1)
        has = np.flatnonzero(self.track_markers >= 0)
        self.refused[has] |= refused[self.track_markers[has]]
        self.track_markers = of[self.track_markers]
        self.markers = of[self.markers]

    def _name(self, w: int, subject: Subject) -> None:
        rows = self.windows.rows(w)
        if not len(rows):
            return
        alive, dense = self.windows.dense(w, rows)
        column = np.searchsorted(alive, self.windows.tracks[rows])
        is_seen = np.isfinite(dense[..., 0])
        lengths = is_seen.sum(axis=0)
        sampled = dense[:: max(1, len(dense) // SAMPLED)]
        if not np.isfinite(sampled[..., 0]).any(axis=0).all():
            sampled = dense  # a track of a single frame needs that frame
        names = np.full(len(alive), -1)
        names[column] = self.markers[rows]
        known = self.track_markers[alive]
        bonus = np.tile(prior_of(self.made), (len(alive), 1))
        has = np.flatnonzero(known >= 0)
        bonus[has, known[has]] += BONUS * np.minimum(lengths[has] / FULL_BONUS, 1)
        bonus[self.refused[alive]] = TAKEN
        labelled = own_log_odds(column, len(alive), self.given[rows], len(self.made))
        scores = np.zeros(bonus.shape)
        for _ in range(ROUNDS):
            scores = labelled + _engine.window_scores(
                np.ascontiguousarray(sampled),
                rows=np.arange(len(alive)),
                holder=_holders(names, lengths, len(self.made)),
                neighbours=subject.neighbours,
                distances=subject.distances,
                variances=subject.variances,
                weights=subject.weights,
            )
            new = _assigned(scores + bonus, is_seen, lengths)
            if np.array_equal(new, names):
                break
            names = new
        self.markers[rows] = names[column]
        first = (self.track_markers[alive] < 0) & (names >= 0)
        self.track_markers[alive[first]] = names[first]
        gains = _exchange_gains(scores, names)
        self.counts[alive] += 1
        self.evidence[alive] += scores
        self.exchanges[alive] += gains
        own = np.where(names >= 0, scores[np.arange(len(names)), names], MIN_LOG_ODDS)
        self.without[alive] += MIN_LOG_ODDS - own

    def _decide(self) -> None:
        """Set the marker of each track by all its windows; two tracks may exchange theirs."""
        own = self.track_markers
        named = np.flatnonzero(own >= 0)
        best = self.evidence[named].argmax(axis=1)
        tracks = self.windows.tracks
        frame = self.windows.detections.frame_of
        used = tracks >= 0
        first = np.full(len(own), np.iinfo(np.int64).max)
        last = np.full(len(own), -1)
        np.minimum.at(first, tracks[used], frame[used])
        np.maximum.at(last, tracks[used], frame[used])
        done: set[int] = set()
        for k, marker in zip(named.tolist(), best.tolist(), strict=True):
            if marker == own[k] or k in done:
                continue
            gain_of: dict[int, float] = {}
            for j in np.flatnonzero((own == marker) & (first <= last[k]) & (last >= first[k])):
                e = self.evidence
                gain_of[int(j)] = e[k, marker] + e[j, own[k]] - e[k, own[k]] - e[j, marker]
            if not gain_of:
                own[k] = marker
                continue
            j = max(gain_of, key=lambda rival: gain_of[rival])
            if len(gain_of) == 1 and gain_of[j] > MIN_GAIN and j not in done:
                own[k], own[j] = own[j], own[k]
                done |= {k, j}


def _holders(
    names: NDArray[np.int64], lengths: NDArray[np.int64], n_markers: int
) -> NDArray[np.int64]:
    """Return the track of each marker, the longest if there are several, -1 for none."""
    holder = np.full(n_markers, -1)
    order = np.argsort(lengths, kind="stable")
    named = order[names[order] >= 0]
    holder[names[named]] = named
    return holder


def _assigned(
    scores: NDArray[np.float64], is_seen: NDArray[np.bool_], lengths: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Name the tracks of the fullest frame by one exact assignment, then the others in turn.

    A marker can name several tracks of a window if they have no common frame.
    """
    from scipy.optimize import linear_sum_assignment

    n, M = scores.shape
    names = np.full(n, -1)
    frame = int(np.argmax((is_seen * lengths).sum(axis=1)))
    core = np.flatnonzero(is_seen[frame])
    alone = np.full((len(core), len(core)), -MIN_LOG_ODDS)
    _, columns = linear_sum_assignment(np.concatenate([-scores[core], alone], axis=1))
    names[core] = np.where(columns < M, columns, -1)
    taken = np.zeros((len(is_seen), M), dtype=bool)
    named = core[names[core] >= 0]
    taken[:, names[named]] = is_seen[:, named]
    rest = np.flatnonzero(~is_seen[frame])
    for k in rest[np.argsort(-scores[rest].max(axis=1), kind="stable")]:
        if scores[k].max() <= MIN_LOG_ODDS:
            break
        free = np.where(taken[is_seen[:, k]].any(axis=0), TAKEN, scores[k])
        marker = int(np.argmax(free))
        if free[marker] > MIN_LOG_ODDS:
            names[k] = marker
            taken[:, marker] |= is_seen[:, k]
    return names


def _exchange_gains(scores: NDArray[np.float64], names: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the gain of each track from each other name, with its holder taking the old name."""
    n, M = scores.shape
    own = np.where(names >= 0, scores[np.arange(n), names], 0.0)
    gain = scores - own[:, None]
    named = np.flatnonzero(names >= 0)
    # What the holder of a marker gains from the name of the track.
    back = np.zeros((n, M))
    from_holder = scores[named][:, np.where(names >= 0, names, 0)] - own[named][:, None]
    from_holder[:, names < 0] = -own[named][:, None]
    back[:, names[named]] = from_holder.T
    gain += back
    gain[np.arange(n)[names >= 0], names[names >= 0]] = 0.0
    return gain
