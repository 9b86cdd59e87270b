"""Names of the tracks of a stream, examined a track at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from asterism import _engine
from asterism.tracking.naming.probabilities import TEMPERATURE
from asterism.tracking.naming.subject import Subject
from asterism.tracking.naming.windows import MIN_LOG_ODDS
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
    marker_of : dict of int to int
        Marker of each named track, by its label; the markers of all sets are numbered together.
    sizes : tuple of float
        Size of each subject relative to its set.
    sums : ndarray of shape (3, M, M)
        Number, sum and sum of squares of the distances between markers.
    subject : Subject
        Tables of all markers.
    rivals : dict of int to (int, float)
        Better marker of a track, -1 for none, and its log odds over several examinations.
    turn : int
        Number of frames so far.
    """

    LENGTH: ClassVar[int] = 5
    """Number of frames by which a track is examined."""

    sets: tuple[MarkerSet, ...]
    marker_of: dict[int, int]
    sizes: tuple[float, ...]
    sums: NDArray[np.float64]
    subject: Subject
    rivals: dict[int, tuple[int, float]]
    turn: int = 0

    @classmethod
    def of(cls, sets: tuple[MarkerSet, ...], names: Mapping[int, str], recent: Frames) -> LiveNames:
        """Measure the subjects in the frames by which they were named."""
        number = {name: m for m, name in enumerate(n for made in sets for n in made.full_names)}
        marker_of = {label: number[name] for label, name in names.items()}
        M = len(number)
        sums = np.zeros((3, M, M))
        for points, labels in recent:
            sums = _engine.with_distances(sums, marker_of, points, labels)
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
        turn, sums, subject = self.turn + 1, self.sums, self.subject
        if turn % EVERY == 0:
            sums = _engine.with_distances(sums, self.marker_of, *recent[-1])
        after = _Changed(self.marker_of, dict(self.rivals), {})
        if len(recent) == self.LENGTH:
            window = _engine.LastTracks(
                recent,
                self.marker_of,
                neighbours=subject.neighbours,
                distances=subject.distances,
                variances=subject.variances,
                weights=subject.weights,
            )
            if (k := window.new(turn)) >= 0:
                self._name_new(after, window, k)
            if (k := window.named(turn)) >= 0:
                self._rename(after, window, k)
                if turn % EVERY == EVERY // 2:
                    subject = self._with_row(window.marker(k), sums)
        live = LiveNames(
            sets=self.sets, marker_of=after.marker_of, sizes=self.sizes, sums=sums,
            subject=subject, rivals=after.rivals, turn=turn,
        )  # fmt: skip
        return live, after.changes

    def _name_new(self, after: _Changed, window: _engine.LastTracks, k: int) -> None:
        """Name a track without a name, if its best free marker leads clearly, or repeatedly."""
        m, lead, probability = window.best_free(k, none=MIN_LOG_ODDS, temperature=TEMPERATURE)
        label = window.label(k)
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

    def _rename(self, after: _Changed, window: _engine.LastTracks, k: int) -> None:
        """Examine a named track; its examinations together may favour another name."""
        label, own = window.label(k), window.marker(k)
        other, gain = window.better(k, none=MIN_LOG_ODDS)
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
        holder = window.holder(other)
        after.set(label, other, self._name(other), probability)
        if holder >= 0:
            after.set(window.label(holder), own, self._name(own), probability)

    def _with_row(self, marker: int, sums: NDArray[np.float64]) -> Subject:
        """Return the tables with one marker measured again."""
        starts = _starts(self.sets)
        s = int(np.searchsorted(starts, marker, side="right")) - 1
        at = starts[s]
        made = self.sets[s]
        found = _distances(sums, np.array([marker]), at, len(made))
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
        self.marker_of = {k: m for k, m in self.marker_of.items() if k != label}
        if marker is not None:
            self.marker_of[label] = marker
        self.changes[label] = None if marker is None else (name, probability)


def _starts(sets: tuple[MarkerSet, ...]) -> list[int]:
    """Return the number of the first marker of each set."""
    return [sum(len(made) for made in sets[:s]) for s in range(len(sets))]


def _distances(
    sums: NDArray[np.float64], markers: NDArray[np.int64], first: int, n_markers: int
) -> Distances:
    """Return the distances from markers to those of one set, by their sums."""
    count, total, squares = sums[:, markers, first : first + n_markers]
    n = np.maximum(count, 1)
    mean = total / n
    middle = np.where(count > 0, mean, np.nan)
    spread = np.sqrt(np.maximum(squares / n - mean * mean, 0))
    return Distances(middle=middle, spread=spread, n_frames=count)


def _with(table: NDArray[Any], row: int, values: NDArray[Any]) -> NDArray[Any]:
    """Return a table with another row."""
    out = table.copy()
    out[row] = values
    return out
