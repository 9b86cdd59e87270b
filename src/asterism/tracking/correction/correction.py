"""Correction of tracks by edits: the most probable tracks that respect what a person states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Edit, TrackingModel, Tracks
from asterism.tracking.correction.change import Change, change_of
from asterism.tracking.correction.constraints import Constraints, detections_of
from asterism.tracking.correction.evidence import Evidence
from asterism.tracking.correction.exchange import Lane, Motion, best_exchange

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.tracking.stitching import Stitching

__all__ = ["Correction"]

CANDIDATES = 3
"""Number of other tracks that are considered for a part that leaves its track."""
CLUTTER = -2
"""Label, while an edit is solved, of the detections without a track that one of them begins."""
TRACKED = 3.0
"""Log odds of a detection that continues a track being of its marker instead of clutter."""
MAX_SHARED = 0.02
"""Largest share of the frames of a track that a track of the same marker may have too."""
IDLE = 50
"""Frames along a track after which no more detections without a track are looked for."""
MIN_FIT = -40.0
"""Smallest log likelihood, relative to straight motion, of a detection that continues another. It
is far below that of a link of the tracker, which misses markers that accelerate."""


class Correction:
    """Tracks under correction; each edit changes only what depends on it.

    An edit states that a part of a track is of the marker of another track, or is not of its own.
    Tracks of one marker that share hardly a frame are joined as a whole. Two other tracks are
    exchanged in intervals of time, of which one holds the part. They are chosen so that the log
    posterior is largest: the distances to other markers of what is exchanged, and the links that
    are cut, as in the identity confidence (`assess`). Detections of earlier edits stay.

    Parameters
    ----------
    tracks : Tracks
        Tracks before any edit.
    model : TrackingModel
        Model of motion and noise with which they were tracked.
    stitching : Stitching, optional
        Stitching that made the tracks.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.model import Edit
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> correction = am.tracking.Correction(truth, model)
    >>> change = correction.apply(Edit(kind="clutter", at=((0, 0),)))
    >>> change.stretches
    (Stretch(first=0, last=39, source=0, target=-1, n_detections=40, is_asked=True),)
    >>> correction.undo().edit == change.edit, correction.undo() is None
    (True, True)
    """

    def __init__(
        self, tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None
    ) -> None:
        check_kind("tracks", tracks, Tracks, "am.track(detections)")
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
        self._tracks, self._d = tracks, tracks.detections
        self._evidence = Evidence(tracks, model, stitching)
        self._motion = Motion(self._d, model)
        self._labels = tracks.labels.copy()
        self._names = list(tracks.names)
        self._constraints = Constraints(self._d)
        self._done: list[tuple[Change, Constraints, int]] = []
        self._now: Tracks | None = None  # made when it is asked for

    def __repr__(self) -> str:
        return f"Correction({self._tracks.n_tracks} tracks, {len(self.edits)} edits)"

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Edits that hold now, in their order."""
        return self._constraints.edits

    @property
    def constraints(self) -> Constraints:
        """Constraints of these edits."""
        return self._constraints

    @property
    def tracks(self) -> Tracks:
        """Tracks now, with the numbers from before; emptied tracks have no detection."""
        if not self._done:
            return self._tracks
        if self._now is None:
            self._now = Tracks(
                detections=self._d, labels=self._labels, names=tuple(self._names),
                info=self._tracks.info, recipe=self._tracks.recipe,
            )  # fmt: skip
        return self._now

    def apply(self, edit: Edit) -> Change:
        """Change the tracks so that they respect one more edit.

        Parameters
        ----------
        edit : Edit
            Next edit.

        Returns
        -------
        Change
            What changed.

        Raises
        ------
        ParameterError
            If it contradicts earlier edits or has no solution; nothing changes then.
        """
        check_kind("edit", edit, Edit, 'Edit(kind="same", at=((10, 3), (48, 0)))')
        constraints = Constraints.of((*self.edits, edit), self._d)
        labels, names = self._labels.copy(), list(self._names)
        own = detections_of(edit, self._d)
        try:
            if edit.kind == "same":
                self._join(own)
            elif edit.kind in ("different", "cut"):
                self._part(own, is_here=edit.kind == "cut")
            elif edit.kind == "clutter":
                self._drop(own[0])
            elif edit.kind == "name":
                self._call(own[0], edit.name)
        except _NoSolution as error:
            self._labels, self._names = labels, names
            hint = "undo an edit in the way, or cut the track there first"
            raise ParameterError(
                "edits", "a solution that respects the earlier edits",
                f"none for {repr(edit)[5:-1]}", hint,
            ) from error  # fmt: skip
        change = change_of(
            edit, own, self._d.frame_of, (labels, self._labels), (names, self._names)
        )
        self._done.append((change, self._constraints, len(names)))
        self._now = None
        self._constraints = constraints
        return change

    def anchor(self, candidates: NDArray[np.int64]) -> int:
        """Return the detection that stands best for the marker of a track.

        It is the middle of the longest part without an uncertain link. A detection that is merely
        near in time may be in a part that is on a wrong track too.

        Parameters
        ----------
        candidates : ndarray of int
            Detections of one track to select from, rising; at least one.
        """
        parts = self._evidence.part_of[candidates]
        own = candidates[parts == np.bincount(parts + 1).argmax() - 1]
        return int(own[len(own) // 2])

    def undo(self) -> Change | None:
        """Take back the last edit, and return what it had changed; None without one."""
        if not self._done:
            return None
        change, self._constraints, n = self._done.pop()
        self._labels[change.detections] = change.before
        self._now = None
        del self._names[n:]
        for track, (before, _) in change.names.items():
            if track < n:
                self._names[track] = before
        return change

    def _join(self, own: Sequence[int]) -> None:
        """Bring two detections to one track."""
        a, b = (int(self._labels[i]) for i in own)
        if a == b >= 0:
            return
        if a < 0 and b < 0:
            a = self._new_track()
            self._take(own[0], a)
        if a < 0 or b < 0:
            (one, other), track = (own, b) if a < 0 else ((own[1], own[0]), a)
            self._take(one, track, beside=other)
            return
        if self._may_be_one(*own):
            frame = self._d.frame_of
            is_shared = np.isin(frame, frame[self._labels == a])
            self._labels[(self._labels == b) & ~is_shared] = a
            if self._names[b] is not None:
                self._names[a], self._names[b] = self._names[b], None
            return
        self._carry_out(
            self._solve(own[1], b, a, beside=own[0]), self._solve(own[0], a, b, beside=own[1])
        )

    def _may_be_one(self, one: int, other: int) -> bool:
        """Return whether the tracks of two detections may be of one marker as a whole.

        They share hardly a frame, no stated detection is in one of these, and neither an edit nor
        their names keep them apart.
        """
        a, b = int(self._labels[one]), int(self._labels[other])
        first, second = (self._d.frame_of[self._labels == k] for k in (a, b))
        shared = np.intersect1d(first, second)
        stated = [i for i in (*self._constraints.pinned, one, other) if self._labels[i] in (a, b)]
        return (
            len(shared) <= MAX_SHARED * min(len(first), len(second))
            and None in (self._names[a], self._names[b])
            and not np.isin(self._d.frame_of[stated], shared).any()
            and all(self._may_be(i, a) for i in stated if self._labels[i] == b)
        )

    def _part(self, own: Sequence[int], is_here: bool) -> None:
        """Bring two detections of one track to different tracks."""
        a, b = (int(self._labels[i]) for i in own)
        if a != b or a < 0:
            return
        found: list[_Solution | None] = []
        later = max(own, key=lambda i: self._d.frame_of[i])
        cut = int(self._d.frame_of[later]) if is_here else None
        for detection, beside in ((own[0], own[1]), (own[1], own[0])):
            others = self._evidence.best(detection, self._labels, CANDIDATES)
            found += [
                self._solve(detection, a, other, cut, beside=beside)
                for other in (*others, len(self._names))
            ]
        self._carry_out(*found)
        if (self._labels == len(self._names)).any():
            self._new_track()

    def _drop(self, detection: int) -> None:
        """Make the part of a detection clutter."""
        track = int(self._labels[detection])
        if track < 0:
            return
        own = np.flatnonzero(
            (self._evidence.part_of == self._evidence.part_of[detection]) & (self._labels == track)
        )
        pinned = np.isin(own, list(self._constraints.pinned))
        frame = self._d.frame_of
        low = frame[own[pinned & (own < detection)]].max(initial=-1)
        high = frame[own[pinned & (own > detection)]].min(initial=self._d.n_frames)
        self._labels[own[(frame[own] > low) & (frame[own] < high)]] = -1

    def _call(self, detection: int, name: str) -> None:
        """Bring a detection to the track of a name."""
        track = int(self._labels[detection])
        named = self._names.index(name) if name in self._names else -1
        if track < 0:
            track = named if named >= 0 else self._new_track()
            self._take(detection, track)
        elif named >= 0 and named != track:
            self._carry_out(self._solve(detection, track, named))
        elif named < 0:
            others = [i for i in self._constraints.pinned if self._labels[i] == track]
            if any(self._constraints.name(i) not in ("", name) for i in others):
                target = self._new_track()
                self._carry_out(self._solve(detection, track, target))
                track = target
            self._names[track] = name
            return
        if named < 0:
            self._names[track] = name

    def _may_be(self, detection: int, track: int) -> bool:
        """Return whether no edit states that a detection is not of the marker of a track."""
        return not any(
            self._constraints.are_different(detection, i)
            for i in self._constraints.pinned
            if self._labels[i] == track
        )

    def _new_track(self) -> int:
        self._names.append(None)
        return len(self._names) - 1

    def _solve(
        self,
        detection: int,
        source: int,
        target: int,
        cut: int | None = None,
        beside: int | None = None,
        labels: NDArray[np.int64] | None = None,
    ) -> _Solution | None:
        """Return the gain and the labels with a detection and its group on another track.

        Detections of other groups stay. The detection `beside` of the same edit stays where it is.
        """
        if not self._may_be(detection, target):
            return None
        labels = self._labels.copy() if labels is None else labels
        group = self._constraints.group(detection)
        own = np.array(sorted(self._constraints.pinned | group))
        is_group = np.isin(own, list(group))
        stated = np.zeros(len(labels), dtype=np.int8)
        stated[own] = np.where(is_group & (labels[own] == source), 1, -1)
        if beside is not None:
            stated[beside] = -1
        lanes = (
            self._lane(source, target, labels, stated),
            self._lane(target, source, labels, stated),
        )
        found = best_exchange(lanes, self._motion, cut)
        if found is None:
            return None
        for lane, then in zip(lanes, (target, source), strict=True):
            labels[lane.detections[found.inside(lane.frames)]] = then
        return found.gain, labels

    def _lane(
        self, track: int, other: int, labels: NDArray[np.int64], stated: NDArray[np.int8]
    ) -> Lane:
        evidence, own = self._evidence, np.flatnonzero(labels == track)
        parts = evidence.part_of[own]
        starts = np.ones(len(own), dtype=bool)
        starts[1:] = parts[1:] != parts[:-1]
        before = np.ones(len(own))
        known = starts & (parts >= 0) & (parts < len(evidence.before))
        before[known] = evidence.before[parts[known]]
        return Lane(
            detections=own,
            frames=self._d.frame_of[own],
            gains=(
                np.full(len(own), TRACKED if track == CLUTTER else -TRACKED)
                if CLUTTER in (track, other)
                else evidence.gains(own, labels, other)
            ),
            starts=starts,
            before=before,
            stated=stated[own],
        )

    def _carry_out(self, *solutions: _Solution | None) -> None:
        """Take the labels with the largest gain."""
        found = [each for each in solutions if each is not None]
        if not found:
            raise _NoSolution
        self._labels = max(found, key=lambda each: each[0])[1]

    def _take(self, detection: int, target: int, beside: int | None = None) -> None:
        """Bring a detection without a track, and those around that continue it, to a track.

        Where the track has a detection in the same frame, both may be exchanged.
        """
        labels, frame = self._labels.copy(), self._d.frame_of
        chain = np.array(self._chain(detection, target))
        is_taken = np.isin(frame[chain], frame[labels == target])
        labels[chain[~is_taken]] = target
        if labels[detection] != target:
            labels[chain[is_taken]] = CLUTTER
            found = self._solve(detection, CLUTTER, target, beside=beside, labels=labels)
            if found is None:
                raise _NoSolution
            labels = found[1]
            labels[labels == CLUTTER] = -1  # given for them, or not taken
        self._labels = labels

    def _chain(self, detection: int, target: int) -> list[int]:
        """Return the detections without a track that continue one of them by motion."""
        d, fixed, labels = self._d, self._constraints.clutter, self._labels
        chain = [detection]
        for way in (1, -1):
            before, head, newest = -1, detection, int(d.frame_of[detection])
            t = newest + way
            while (
                0 <= t < d.n_frames
                and abs(t - int(d.frame_of[head])) <= self._motion.max_gap
                and abs(t - newest) <= IDLE
            ):
                own = np.arange(d.offsets[t], d.offsets[t + 1])
                own = own[(labels[own] < 0) | (labels[own] == target)]
                own = own[[i not in fixed for i in own.tolist()]] if fixed else own
                if len(own):
                    fits = self._motion.continuation(before, head, own)
                    best = int(np.argmax(fits))
                    if fits[best] >= MIN_FIT:
                        before, head = head, int(own[best])
                        if labels[head] < 0:
                            chain.append(head)
                            newest = t
                t += way
        return chain


_Solution = tuple[float, "NDArray[np.int64]"]


class _NoSolution(Exception):
    """No exchange respects the earlier edits."""
