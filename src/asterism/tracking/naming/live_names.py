"""Names of the tracks of a stream, examined a track at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import repeat
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from asterism import _engine
from asterism.tracking.naming.probabilities import TEMPERATURE
from asterism.tracking.naming.subject import Subject
from asterism.tracking.naming.windows import MIN_LOG_ODDS, TAKEN
from asterism.tracking.rigidity.distances import Distances

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from asterism.model import MarkerSet

    Frames = Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]]  # points, and their labels
    Changes = dict[int, tuple[str, float] | None]  # label -> name and its probability

__all__ = ["LiveNames"]

MARGIN, MIN_SUM = 4.0, 8.0
"""Log odds by which the best name of a new track must exceed the next: in one examination, or in
the sum of several that favour the same name."""
MIN_CHANGE = 16.0
"""Sum of log odds by which examinations of a track must favour another name."""
MAX_EACH = 8.0
"""Largest log odds of one examination, so that a single one never changes a name."""
EVERY = 10
"""Number of frames between two poses that are measured, and between two measured markers."""
RIGID = 0.006
"""Spread of distances, metres, by which the size of the subject is measured."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LiveNames:
    """Names of tracks, and the subjects as measured so far.

    Parameters
    ----------
    sets : tuple of MarkerSet
        Marker set of each subject.
    marker_of : mapping of int to int
        Marker of each named track, by its label; the markers of all sets are numbered together.
    sizes : tuple of float
        Size of each subject relative to its set.
    sums : ndarray of shape (3, M, M)
        Number, sum and sum of squares of the distances between markers.
    subject : Subject
        Tables of all markers.
    rivals : mapping of int to (int, float)
        Better marker of a track, -1 for none, and its log odds over several examinations.
    turn : int
        Number of frames so far.
    """

    LENGTH: ClassVar[int] = 5
    """Number of frames by which a track is examined."""

    sets: tuple[MarkerSet, ...]
    marker_of: Mapping[int, int]
    sizes: tuple[float, ...]
    sums: NDArray[np.float64]
    subject: Subject
    rivals: Mapping[int, tuple[int, float]]
    turn: int = 0

    @classmethod
    def of(cls, sets: tuple[MarkerSet, ...], names: Mapping[int, str], recent: Frames) -> LiveNames:
        """Measure the subjects in the frames by which they were named."""
        number = {name: m for m, name in enumerate(n for made in sets for n in made.full_names)}
        marker_of = {label: number[name] for label, name in names.items()}
        M = len(number)
        sums = np.zeros((3, M, M))
        for points, labels in recent:
            sums = sums + _distance_sums(marker_of, points, labels, M)
        sizes: list[float] = []
        tables: list[Subject] = []
        for at, made in zip(_starts(sets), sets, strict=True):
            found = _distances(sums, at + np.arange(len(made)), at, len(made))
            rigid = (found.n_frames > 0) & (found.spread < RIGID) & (made.distances > 0)
            ratios = found.middle[rigid] / made.distances[rigid]
            sizes.append(float(np.median(ratios)) if len(ratios) else 1.0)
            own = Subject.of(made, sizes[-1], found, is_kept=False)
            tables.append(replace(own, neighbours=own.neighbours + at))
        subject = Subject(
            neighbours=np.concatenate([own.neighbours for own in tables]),
            distances=np.concatenate([own.distances for own in tables]),
            variances=np.concatenate([own.variances for own in tables]),
            weights=np.concatenate([own.weights for own in tables]),
        )
        return cls(
            sets=sets,
            marker_of=marker_of,
            sizes=tuple(sizes),
            sums=sums,
            subject=subject,
            rivals={},
        )

    def followed(self, recent: Frames) -> tuple[LiveNames, Changes]:
        """Examine a named track and one without a name, and measure one marker again.

        Parameters
        ----------
        recent : sequence of (points, labels)
            The last frames.

        Returns
        -------
        live, changes
            Names after these frames, and what has changed: name and probability by label, or None
            for a track that has lost its name.
        """
        turn, sums = self.turn + 1, self.sums
        points, labels = recent[-1]
        if turn % EVERY == 0:
            sums = sums + _distance_sums(self.marker_of, points, labels, sums.shape[1])
        after = LiveNames(
            sets=self.sets, marker_of=self.marker_of, sizes=self.sizes, sums=sums,
            subject=self.subject, rivals=self.rivals, turn=turn,
        )  # fmt: skip
        alive = np.sort(labels[labels >= 0])
        if len(recent) < self.LENGTH or len(alive) < 2:
            return after, {}
        return after._examined(alive, recent)

    def _examined(self, alive: NDArray[np.int64], recent: Frames) -> tuple[LiveNames, Changes]:
        window = _Window(self, alive, _engine.positions_of_labels(alive, recent))
        after = _Changed(dict(self.marker_of), dict(self.rivals), {})
        new = np.flatnonzero((window.marker < 0) & window.is_whole)
        named = np.flatnonzero(window.marker >= 0)
        subject = self.subject
        if len(new):
            self._name_new(after, window, int(new[self.turn % len(new)]))
        if len(named):
            k = int(named[self.turn % len(named)])
            self._rename(after, window, k)
            if self.turn % EVERY == EVERY // 2:
                subject = self._with_row(int(window.marker[k]))
        made = LiveNames(
            sets=self.sets, marker_of=after.marker_of, sizes=self.sizes, sums=self.sums,
            subject=subject, rivals=after.rivals, turn=self.turn,
        )  # fmt: skip
        return made, after.changes

    def _name_new(self, after: _Changed, window: _Window, k: int) -> None:
        """Name a track without a name, if its best free marker leads clearly, or repeatedly."""
        m, lead, probability = window.best_free(k)
        label = int(window.alive[k])
        before, sum_before = after.rivals.pop(label, (m, 0.0))
        total = max(lead, 0.0) + (sum_before if before == m else 0.0)
        if lead <= 0:
            return
        if lead < MARGIN and total < MIN_SUM:
            after.rivals[label] = m, total
            return
        for holder in [own for own, marker in after.marker_of.items() if marker == m]:
            after.set(holder, None)  # it has ended
        after.set(label, m, self._name(m), probability)

    def _rename(self, after: _Changed, window: _Window, k: int) -> None:
        """Examine a named track; its examinations together may favour another name."""
        label, own = int(window.alive[k]), int(window.marker[k])
        other, gain = window.better(k, own)
        before, sum_before = after.rivals.pop(label, (own, 0.0))
        total = min(gain, MAX_EACH) + (sum_before if before == other else 0.0)
        if other == own or total <= 0:
            return
        if total <= MIN_CHANGE:
            after.rivals[label] = other, total
            return
        probability = float(1 / (1 + np.exp(-total / TEMPERATURE)))
        if other < 0:
            after.set(label, None)
            return
        holder = window.holder[other]
        after.set(label, other, self._name(other), probability)
        if holder >= 0:
            after.set(int(window.alive[holder]), own, self._name(own), probability)

    def _with_row(self, marker: int) -> Subject:
        """Return the tables with one marker measured again."""
        starts = _starts(self.sets)
        s = int(np.searchsorted(starts, marker, side="right")) - 1
        at = starts[s]
        made = self.sets[s]
        found = _distances(self.sums, np.array([marker]), at, len(made))
        row = Subject.of(made, self.sizes[s], found, is_kept=False, markers=np.array([marker - at]))
        own = self.subject
        return Subject(
            neighbours=_with(own.neighbours, marker, row.neighbours + at),
            distances=_with(own.distances, marker, row.distances),
            variances=_with(own.variances, marker, row.variances),
            weights=_with(own.weights, marker, row.weights),
        )

    def _name(self, marker: int) -> str:
        return [name for made in self.sets for name in made.full_names][marker]


@dataclass(eq=False)
class _Changed:
    """Names while a frame is examined: `marker_of` and `rivals` of `LiveNames`, and changes."""

    marker_of: dict[int, int]
    rivals: dict[int, tuple[int, float]]
    changes: Changes

    def set(self, label: int, marker: int | None, name: str = "", probability: float = 0.0) -> None:
        """Set the marker of a track, None for none."""
        self.marker_of.pop(label, None)
        if marker is not None:
            self.marker_of[label] = marker
        self.changes[label] = None if marker is None else (name, probability)


class _Window:
    """Tracks in a few frames, and the scores of their names."""

    def __init__(
        self, names: LiveNames, alive: NDArray[np.int64], dense: NDArray[np.float64]
    ) -> None:
        self.alive, self.dense = alive, dense
        self.is_whole = ~np.isnan(dense[..., 0]).any(axis=0)
        self.tables = names.subject
        found = map(names.marker_of.get, alive.tolist(), repeat(-1))
        self.marker = np.fromiter(found, np.int64, len(alive))
        self.holder = np.full(names.sums.shape[1], -1)
        has = np.flatnonzero(self.marker >= 0)
        self.holder[self.marker[has]] = has

    def scores(self, k: int) -> NDArray[np.float64]:
        """Return the log odds of all markers for a track, (M,)."""
        return _engine.window_scores(
            self.dense,
            rows=np.array([k]),
            holder=self.holder,
            neighbours=self.tables.neighbours,
            distances=self.tables.distances,
            variances=self.tables.variances,
            weights=self.tables.weights,
        )[0]

    def best_free(self, k: int) -> tuple[int, float, float]:
        """Return the best marker that no track has, its lead in log odds, and its probability."""
        scores = np.where(self.holder < 0, self.scores(k), TAKEN)
        m = int(np.argmax(scores))
        best, scores[m] = float(scores[m]), MIN_LOG_ODDS  # of no name
        lead = best - float(scores.max())
        return m, lead, float(1 / (1 + np.exp((scores - best) / TEMPERATURE).sum()))

    def better(self, k: int, own: int) -> tuple[int, float]:
        """Return the marker that a track should have, -1 for none, and what that would gain.

        A holder of that marker would get the name of the track.
        """
        scores = self.scores(k)
        m = int(np.argmax(scores))
        if scores[m] < MIN_LOG_ODDS:
            return -1, float(MIN_LOG_ODDS - scores[own])
        gain = float(scores[m] - scores[own])
        if m != own and self.holder[m] >= 0:
            back = self.scores(int(self.holder[m]))
            gain += float(back[own] - back[m])
        return m, gain


def _distance_sums(
    marker_of: Mapping[int, int], points: NDArray[np.float64], labels: NDArray[np.int64], M: int
) -> NDArray[np.float64]:
    """Return whether markers have a distance in a frame, the distance and its square, (3, M, M)."""
    markers = np.fromiter(map(marker_of.get, labels.tolist(), repeat(-1)), np.int64, len(labels))
    pose = _engine.positions_of_labels(np.arange(M), [(points, markers)])[0]
    offsets = pose[:, None] - pose
    squares = np.einsum("ijd,ijd->ij", offsets, offsets)
    known = ~np.isnan(squares)
    squares[~known] = 0
    return np.stack([known, np.sqrt(squares), squares])


def _starts(sets: tuple[MarkerSet, ...]) -> list[int]:
    """Return the number of the first marker of each set."""
    return [sum(len(made) for made in sets[:s]) for s in range(len(sets))]


def _distances(
    sums: NDArray[np.float64], markers: NDArray[np.int64], first: int, n_markers: int
) -> Distances:
    """Return the distances from markers to those of one set, by their sums."""
    own = sums[:, markers, first : first + n_markers]
    count, total, squares = own[0], own[1], own[2]
    n = np.maximum(count, 1)
    middle = np.where(count > 0, total / n, np.nan)
    spread = np.sqrt(np.maximum(squares / n - (total / n) ** 2, 0))
    return Distances(middle=middle, spread=spread, n_frames=count)


def _with(table: NDArray[Any], row: int, values: NDArray[Any]) -> NDArray[Any]:
    """Return a table with another row."""
    out = table.copy()
    out[row] = values
    return out
