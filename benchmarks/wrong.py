"""Wrong detections of tracks, by the labels of a file and where these are wrong themselves.

Where a track and the labels of a file differ, one of both is wrong. A run of detections that a
track holds under another label is an error of the file in four cases. All markers concerned are
within millimetres of each other, so that nothing shows which is which. Or the cameras have merged
two markers, so that one of them is missed and the detection is in the middle. Or the motion of the
track is continuous at the ends of the run from one frame to the next, where the labels of the file
jump; at deviations of centimetres the distances must favour the track too. Or the distances to the
other labels are clearly those of the marker of the track, not those of the label. A run is judged
as a whole, and then each stretch of it under one label.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator

    import asterism as am

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NEXT = 2
"""Largest number of frames from one detection to the next at which motion is compared."""
MAX_GAP = 10
"""Largest number of frames from one detection of a track to the next, between which the labels of
the file may change."""
CONTINUOUS = 0.005
"""Deviation from straight motion, metres, within which motion is continuous."""
RELATIVE, JUMP = 0.35, 0.01
"""Largest deviation relative to that of the labels of the file, and the smallest one of these,
metres."""
SAME_PLACE = 0.003
"""Distance of two detections, metres, within which nothing shows which of them is which marker."""
MERGED = 0.25
"""Largest distance from the middle of two markers of a detection of both, relative to the distance
of the two."""
MIN_REFERENCES, MAX_REFERENCES = 4, 8
MIN_FRAMES = 8
"""Smallest number of frames of a distance."""
MIN_CONTRAST = 2.0
"""Smallest difference of the distances of two markers to a third, in deviations."""
MIN_RATIO = 1.0
"""Log density ratio of a distance, in the mean, from which on the label is wrong."""


class Run(NamedTuple):
    """Run of wrong detections of a track."""

    track: int
    first: int
    last: int
    kind: Literal["switch", "clutter", "label error"]
    detections: Indices


def is_wrong(tracks: am.Tracks, truth: am.Tracks) -> NDArray[np.bool_]:
    """Return for each detection whether it is not of the marker that holds most of its track."""
    inside = (tracks.labels >= 0) & (truth.labels >= 0)
    counts = np.zeros((tracks.n_tracks, truth.n_tracks), dtype=np.int64)
    np.add.at(counts, (tracks.labels[inside], truth.labels[inside]), 1)
    most = np.where(counts.any(axis=1), counts.argmax(axis=1), -2)
    return (tracks.labels >= 0) & (truth.labels != most[tracks.labels])


def wrong_runs(tracks: am.Tracks, truth: am.Tracks, file: am.Tracks | None = None) -> list[Run]:
    """Return the runs of wrong detections of all tracks.

    The labels are judged as in the file, which has all detections of the run and of the frames
    around it; without a file, as in `truth`.

    Parameters
    ----------
    tracks : Tracks
        Tracks that are judged.
    truth : Tracks
        The same detections, with the labels of the file.
    file : Tracks, optional
        The capture from which the detections were taken, with the same tracks, and times.
    """
    order, offsets = tracks.by_track
    wrong, named = is_wrong(tracks, truth), truth.labels >= 0
    frame = tracks.detections.frame_of
    labels = Labels(truth, file or truth)
    found: list[Run] = []
    for k in range(tracks.n_tracks):
        own = order[offsets[k] : offsets[k + 1]]
        inside = own[named[own]]
        marker = int(np.bincount(truth.labels[inside]).argmax()) if len(inside) else -1
        for whole in _runs(wrong[inside]):
            pieces = [whole]
            if not labels.is_error(inside, *whole, marker):
                pieces = _of_one_label(truth.labels[inside], *whole)
            for begin, end in pieces:
                kind = "label error" if labels.is_error(inside, begin, end, marker) else "switch"
                run = inside[begin:end]
                found.append(Run(k, int(frame[run[0]]), int(frame[run[-1]]), kind, run))
        for begin, end in _runs(~named[own]):
            run = own[begin:end]
            found.append(Run(k, int(frame[run[0]]), int(frame[run[-1]]), "clutter", run))
    return found


def _of_one_label(labels: Indices, begin: int, end: int) -> list[tuple[int, int]]:
    cuts = begin + 1 + np.flatnonzero(np.diff(labels[begin:end]))
    return list(itertools.pairwise([begin, *cuts.tolist(), end]))


def _runs(values: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], values.astype(int), [0]])))
    yield from ((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))


class Labels:
    """Labels of a file, by which runs of detections are judged.

    Parameters
    ----------
    truth : Tracks
        Detections, with the labels of the file.
    file : Tracks
        The capture from which they were taken.
    """

    def __init__(self, truth: am.Tracks, file: am.Tracks) -> None:
        self.labels, self.points = truth.labels, truth.detections.points
        times = file.detections.times
        half = float(np.diff(times).min(initial=1.0)) / 2
        self.frame = np.searchsorted(times, truth.detections.times - half)[
            truth.detections.frame_of
        ]
        self.dense = file.positions()

    def is_error(self, own: Indices, begin: int, end: int, marker: int) -> bool:
        """Return whether the labels of a run of detections are wrong.

        Parameters
        ----------
        own : ndarray of int
            Detections of a track, in order of time.
        begin, end : int
            The run, ``own[begin:end]``.
        marker : int
            Label of most detections of the track.
        """
        run = own[begin:end]
        if (
            self._is_same_place(run, marker)
            or self._is_merged(run, marker)
            or self._is_continuous(own, begin, end, marker, CONTINUOUS)
        ):
            return True
        ratio = self._least_ratio(run, marker)
        return ratio > MIN_RATIO or (
            ratio > 0 and self._is_continuous(own, begin, end, marker, np.inf)
        )

    def _is_same_place(self, run: Indices, marker: int) -> bool:
        apart = self.points[run] - self.dense[self.frame[run], marker]
        return bool((np.linalg.norm(apart, axis=1) < SAME_PLACE).all())

    def _is_merged(self, run: Indices, marker: int) -> bool:
        """Return whether the detections of a run are of two markers that the cameras merged.

        The marker of the track is missed in all of the run, and the detection at either end is in
        the middle of where both markers are expected by their motion in the nearest frame outside.
        """
        if not np.isnan(self.dense[self.frame[run], marker]).all():
            return False
        votes: list[bool] = []
        for i, way in ((run[0], 1), (run[-1], -1)):
            at, pair = int(self.frame[i]), [marker, int(self.labels[i])]
            for outside in range(at - way, at - way * (NEXT + 1), -way):
                if not 0 <= outside < len(self.dense) or np.isnan(self.dense[outside, pair]).any():
                    continue
                one, other = (
                    self.dense[outside, k] + (at - outside) * self._velocity(k, outside, -way)
                    for k in pair
                )
                off = _lengths(self.points[i] - (one + other) / 2)
                votes.append(bool(off < MERGED * _lengths(one - other)))
                break
        return bool(votes) and all(votes)

    def _is_continuous(self, own: Indices, begin: int, end: int, marker: int, most: float) -> bool:
        """Return whether the motion is continuous where the labels change, before and after."""
        votes: list[bool] = []
        for at, way in ((begin, 1), (end - 1, -1)):
            if not 0 <= at - way < len(own) or self.labels[own[at - way]] != marker:
                continue
            outside, inside = int(self.frame[own[at - way]]), int(self.frame[own[at]])
            links = list(self._links(outside, inside, marker, int(self.labels[own[at]])))
            if links:
                votes.append(any(jump > JUMP and kept < min(RELATIVE * jump, most)
                                 for kept, jump in links))  # fmt: skip
        return bool(votes) and all(votes)

    def _links(
        self, outside: int, inside: int, marker: int, label: int
    ) -> Iterator[tuple[float, float]]:
        """Yield the deviations of links from one label to the other, and the least of other links.

        Others are those from the first detection to the other ones of the next frame, among them
        those by the labels of the file, and those to the second from the other ones. The labels may
        change anywhere from the last detection outside a run to the first inside.
        """
        way = 1 if inside > outside else -1
        if (inside - outside) * way > MAX_GAP:
            return
        seen = [
            [f for f in range(outside, inside + way, way) if not np.isnan(self.dense[f, k]).any()]
            for k in (marker, label)
        ]
        for a, b in itertools.product(*seen):
            n = (b - a) * way
            if not 0 < n <= NEXT:
                continue
            before, after = self._velocity(marker, a, -way), self._velocity(label, b, way)
            begin, end = self.dense[a, marker], self.dense[b, label]
            links = np.concatenate(
                [[end - begin],
                 np.delete(self.dense[b], label, axis=0) - begin,
                 end - np.delete(self.dense[a], marker, axis=0)]
            )  # fmt: skip
            off = np.minimum(*(_lengths(links - n * way * v) for v in (before, after)))
            yield float(off[0]), float(np.nanmin(off[1:], initial=np.inf))

    def _velocity(self, label: int, frame: int, way: int) -> Array:
        """Return the motion of a label a frame, from a frame to the next one in a direction."""
        for n in range(1, NEXT + 1):
            other = frame + way * n
            if 0 <= other < len(self.dense) and not np.isnan(self.dense[other, label]).any():
                return way * (self.dense[other, label] - self.dense[frame, label]) / n
        return np.zeros(self.dense.shape[2])

    def _least_ratio(self, run: Indices, marker: int) -> float:
        """Return the smallest ratio of the labels of a run."""
        return min(
            self._ratio(self.frame[run[self.labels[run] == label]], int(label), marker)
            for label in np.unique(self.labels[run])
        )

    def _ratio(self, frames: Indices, label: int, marker: int) -> float:
        """Return the mean log density ratio of the distances of a label being those of a marker."""
        others = np.setdiff1d(np.arange(self.dense.shape[1]), (label, marker))
        outside = np.setdiff1d(np.arange(len(self.dense)), frames)
        of_label, of_marker = (self._distances(each, outside, others) for each in (label, marker))
        found = _median(self._all_distances(label, frames, others))
        contrast = np.abs(of_label[0] - of_marker[0]) / np.hypot(of_label[1], of_marker[1])
        used = np.flatnonzero((contrast > MIN_CONTRAST) & ~np.isnan(found))
        if len(used) < MIN_REFERENCES:
            return 0.0
        used = used[np.argsort(-contrast[used])][:MAX_REFERENCES]
        a, b = (
            -2 * np.log1p(((found - m)[used] / s[used]) ** 2 / 3) - np.log(s[used])
            for m, s in (of_marker, of_label)
        )
        return float(np.mean(a - b))

    def _all_distances(self, label: int, frames: Indices, others: Indices) -> Array:
        at = self.dense[frames]
        return np.linalg.norm(at[:, others] - at[:, [label]], axis=-1)

    def _distances(self, label: int, frames: Indices, others: Indices) -> tuple[Array, Array]:
        """Return median and spread of the distances of a label to others, NaN for unknown ones."""
        d = self._all_distances(label, frames, others)
        d[:, (~np.isnan(d)).sum(axis=0) < MIN_FRAMES] = np.nan
        median = _median(d)
        deviation = 1.4826 * _median(np.abs(d - median))
        return median, np.maximum(deviation, SAME_PLACE + 0.02 * median)


def _lengths(v: Array) -> Array:
    return np.linalg.norm(v, axis=-1)


def _median(d: Array) -> Array:
    """Return the median of each column without its NaN, NaN for a column of NaN."""
    found = np.full(d.shape[1], np.nan)
    known = ~np.isnan(d).all(axis=0)
    found[known] = np.nanmedian(d[:, known], axis=0)
    return found
