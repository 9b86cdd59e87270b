"""Solution of edits: the most probable labels that respect what a person states."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Tracks
from asterism.model.edit import REASSIGN
from asterism.tracking.confidence.identity import assess
from asterism.tracking.confidence.reassign import PROBABLE, UNCERTAIN
from asterism.tracking.correction.assignment import assigned_again
from asterism.tracking.correction.constraints import Constraints, detections_of
from asterism.tracking.correction.continuation import continuation
from asterism.tracking.correction.evidence import Evidence
from asterism.tracking.correction.exchange import Lane, Motion, best_exchange
from asterism.tracking.correction.lanes import CLUTTER, Lanes
from asterism.tracking.correction.settled import settled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Edit, TrackingModel
    from asterism.tracking.stitching import Stitching

__all__ = ["NoSolution", "Solver"]

CANDIDATES = 3
"""Number of other tracks that are considered for a part that leaves its track."""
MAX_SHARED = 0.1
"""Largest share of the frames of a track that a track of the same marker may have too."""


class NoSolution(Exception):
    """No exchange respects the earlier edits."""


class Solver:
    """Labels and names under correction, with the evidence for changes.

    Parameters
    ----------
    tracks, model, stitching
        As for `Correction`.

    Attributes
    ----------
    labels : ndarray of int, shape (N,)
        Track of each detection now, -1 for clutter.
    names : list of (str or None)
        Name of each track now.
    evidence : Evidence
        Parts of the tracks before any edit.
    """

    def __init__(
        self, tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None
    ) -> None:
        self._d, self._model, self._stitching = tracks.detections, model, stitching
        self.evidence = Evidence(tracks, model, stitching)
        self._motion, self._lanes = Motion(self._d, model), Lanes(self._d, self.evidence)
        self.labels = tracks.labels.copy()
        self.names = list(tracks.names)
        self._constraints = Constraints(self._d)

    def solve(self, edit: Edit, constraints: Constraints) -> None:
        """Change labels and names so that they respect one more edit.

        Parameters
        ----------
        edit : Edit
            Next edit.
        constraints : Constraints
            Constraints of the earlier edits.

        Raises
        ------
        NoSolution
            If no exchange respects the earlier edits; labels and names may have changed.
        """
        self._constraints = constraints
        own = detections_of(edit, self._d)
        if edit.kind == "same":
            self._join(own)
        elif edit.kind == "only":
            self._move(own[0], own[1], own[-1])
        elif edit.kind in ("different", "cut"):
            self._part(own, is_here=edit.kind == "cut")
        elif edit.kind == "clutter":
            self._drop(own[0])
        elif edit.kind == "name":
            self._call(own[0], edit.name)
        elif edit.kind in REASSIGN:
            self._reassign(own, is_even=edit.kind == "reassign_even")
        if edit.kind in ("same", "name"):
            self._collect(int(self.labels[own[0]]))

    def _join(self, own: Sequence[int]) -> None:
        """Bring two detections to one track."""
        a, b = (int(self.labels[i]) for i in own)
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
            is_shared = np.isin(frame, frame[self.labels == a])
            self.labels[(self.labels == b) & ~is_shared] = a
            if self.names[b] is not None:
                self.names[a], self.names[b] = self.names[b], None
            return
        ways = [(own[1], b, a, own[0]), (own[0], a, b, own[1])]
        is_stated = [i in self._constraints.pinned for i in own]
        if is_stated[0] != is_stated[1]:  # what was stated stays
            ways = [ways[is_stated[1]]]
        self._carry_out(*(self._solve(*each[:3], beside=each[3]) for each in ways))

    def _move(self, one: int, first: int, last: int) -> None:
        """Bring the detections of a track from one to another to a third one's, in exchange."""
        labels, frame = self.labels, self._d.frame_of
        source, target = int(labels[first]), int(labels[one])
        if target < 0:
            labels[one] = target = self._new_track()
        inside = (frame >= frame[first]) & (frame <= frame[last])
        moved = [first, last]
        if source >= 0:
            moved = np.flatnonzero(inside & (labels == source)).tolist()
        there = np.flatnonzero(inside & (labels == target) & np.isin(frame, frame[moved]))
        stated = self._constraints
        if (
            not {first, last} <= set(moved)
            or stated.pinned & set(there.tolist())
            or not all(stated.group(i) <= {*moved, *stated.group(one)} for i in moved)
            or not all(self._may_be(i, target) for i in moved)
        ):
            raise NoSolution
        labels[there], labels[moved] = source, target

    def _may_be_one(self, one: int, other: int) -> bool:
        """Return whether the tracks of two detections may be of one marker as a whole.

        They share hardly a frame, no stated detection is in one of these, and neither an edit nor
        their names keep them apart.
        """
        a, b = int(self.labels[one]), int(self.labels[other])
        first, second = (self._d.frame_of[self.labels == k] for k in (a, b))
        shared = np.intersect1d(first, second)
        stated = [i for i in (*self._constraints.pinned, one, other) if self.labels[i] in (a, b)]
        return (
            len(shared) <= MAX_SHARED * min(len(first), len(second))
            and None in (self.names[a], self.names[b])
            and not np.isin(self._d.frame_of[stated], shared).any()
            and all(self._may_be(i, a) for i in stated if self.labels[i] == b)
        )

    def _part(self, own: Sequence[int], is_here: bool) -> None:
        """Bring two detections of one track to different tracks."""
        a, b = (int(self.labels[i]) for i in own)
        if a != b or a < 0:
            return
        found: list[_Solution | None] = []
        later = max(own, key=lambda i: self._d.frame_of[i])
        cut = int(self._d.frame_of[later]) if is_here else None
        targets = [[*self.evidence.best(i, self.labels, CANDIDATES), len(self.names)] for i in own]
        lanes = self._lanes.between(a, list(dict.fromkeys(itertools.chain(*targets))), self.labels)
        for detection, beside, others in zip(own, reversed(own), targets, strict=True):
            found += [
                self._solve(detection, a, other, cut, beside=beside, lanes=lanes[other])
                for other in others
            ]
        self._carry_out(*found)
        if (self.labels == len(self.names)).any():
            self._new_track()

    def _drop(self, detection: int) -> None:
        """Make the part of a detection clutter.

        Detections that no tracklet had are a part as far as they follow each other in the track. If
        the part keeps the distances of its track and the detection does not, it is dropped alone.
        """
        track = int(self.labels[detection])
        if track < 0:
            return
        own = np.flatnonzero(self.labels == track)
        is_in = self.evidence.part_of[own] == self.evidence.part_of[detection]
        if self.evidence.part_of[detection] < 0:
            runs = np.cumsum(~is_in)
            is_in &= runs == runs[np.searchsorted(own, detection)]
        own = own[is_in]
        unknown = len(self.names)
        gain = self.evidence.gains(own, np.zeros_like(own), self.labels, [unknown])[0].sum()
        if self._fits_alone(detection, gain, unknown):
            own = np.array([detection])
        pinned = np.isin(own, list(self._constraints.pinned))
        frame = self._d.frame_of
        low = frame[own[pinned & (own < detection)]].max(initial=-1)
        high = frame[own[pinned & (own > detection)]].min(initial=self._d.n_frames)
        self.labels[own[(frame[own] > low) & (frame[own] < high)]] = -1

    def _call(self, detection: int, name: str) -> None:
        """Bring a detection to the track of a name."""
        track = int(self.labels[detection])
        named = self.names.index(name) if name in self.names else -1
        if track < 0:
            track = named if named >= 0 else self._new_track()
            self._take(detection, track)
        elif named >= 0 and named != track:
            self._carry_out(self._solve(detection, track, named))
        elif named < 0:
            others = [i for i in self._constraints.pinned if self.labels[i] == track]
            if any(self._constraints.name(i) not in ("", name) for i in others):
                target = self._new_track()
                self._carry_out(self._solve(detection, track, target))
                track = target
        if named < 0:
            self.names[track] = name

    def _may_be(self, detection: int, track: int) -> bool:
        """Return whether no edit states that a detection is not of the marker of a track."""
        return not any(
            self._constraints.are_different(detection, i)
            for i in self._constraints.pinned
            if self.labels[i] == track
        )

    def _new_track(self) -> int:
        self.names.append(None)
        return len(self.names) - 1

    def _solve(
        self,
        detection: int,
        source: int,
        target: int,
        cut: int | None = None,
        beside: int | None = None,
        lanes: tuple[Lane, Lane] | None = None,
    ) -> _Solution | None:
        """Return the gain and the moves that bring a detection and its group to another track.

        Detections of other groups stay. The detection `beside` of the same edit stays where it is.
        The lanes are those of both tracks, by default as the labels are now.
        """
        if not self._may_be(detection, target):
            return None
        is_new = target == len(self.names)
        if lanes is None or is_new:
            lanes = lanes or self._lanes.between(source, [target], self.labels)[target]
            part = int(self.evidence.part_of[detection])
            gain = lanes[0].gains[self.evidence.part_of[lanes[0].detections] == part].sum()
            if source != CLUTTER and self._fits_alone(detection, gain, target):
                lanes = self._lanes.of(source, [target], self.labels, part)[0], lanes[1]
        group = self._constraints.group(detection)
        both = group if beside is None else {*group, beside}
        own = np.array(sorted(self._constraints.pinned | both))
        track = self.labels[own]
        stated = np.where((track == source) & np.isin(own, list(group)) & (own != beside), 1, -1)
        for lane, k in zip(lanes, (source, target), strict=True):
            lane.stated[:] = 0
            lane.stated[np.searchsorted(lane.detections, own[track == k])] = stated[track == k]
        found = best_exchange(lanes, self._motion, cut)
        if found is None:
            return None
        return found.gain, [
            (lane.detections[found.inside(lane.frames)], then)
            for lane, then in zip(lanes, (target, source), strict=True)
        ]

    def _fits_alone(self, detection: int, gain: float, target: int) -> bool:
        """Return whether a detection fits another track that its part does not fit.

        The gain is that of the part.
        """
        own = np.array([detection])
        return gain < 0 < self.evidence.gains(own, own, self.labels, [target])[0, 0]

    def _carry_out(self, *solutions: _Solution | None) -> None:
        """Make the moves with the largest gain."""
        found = [each for each in solutions if each is not None]
        if not found:
            raise NoSolution
        for detections, track in max(found, key=lambda each: each[0])[1]:
            self.labels[detections] = track

    def _take(self, detection: int, target: int, beside: int | None = None) -> None:
        """Bring a detection without a track, and those around that continue it, to a track.

        Where the track has a detection in the same frame, both may be exchanged.
        """
        labels, frame = self.labels, self._d.frame_of
        chain = np.array(
            continuation(
                self._d, detection, target, labels, self._free(), self.evidence, self._motion
            )
        )
        is_taken = np.isin(frame[chain], frame[labels == target])
        labels[chain[~is_taken]] = target
        if labels[detection] != target:
            labels[chain[is_taken]] = CLUTTER
            self._carry_out(self._solve(detection, CLUTTER, target, beside=beside))
            labels[labels == CLUTTER] = -1  # given for them, or not taken

    def _collect(self, track: int) -> None:
        """Bring the detections without a track that probably are of the marker of a track to it."""
        labels, frame = self.labels, self._d.frame_of
        own = np.flatnonzero(labels == track)
        is_known = np.zeros(self._d.n_frames, dtype=bool)
        is_known[frame[own]] = True
        free = self._free()
        others = np.flatnonzero(free & ~is_known[frame])
        if not len(others):
            return
        odds = self.evidence.log_odds(others, labels, track) - self.evidence.ghost[others]
        odds += self._motion.log_odds(own, others, free.sum() / self._d.n_frames)
        others = others[np.argsort(-odds, kind="stable")][: int((odds > PROBABLE).sum())]
        _, first = np.unique(frame[others], return_index=True)  # the most probable of each frame
        labels[others[first]] = track

    def _reassign(self, kept: Sequence[int], *, is_even: bool) -> None:
        """Assign the uncertain detections and those without a track once more, without some."""
        tracks = Tracks(detections=self._d, labels=self.labels, names=tuple(self.names))
        assessed = settled(
            assess(tracks, self._model, self._stitching), self._constraints.edits
        ).identity_confidence
        assert assessed is not None
        is_open = (self.labels >= 0) & (assessed < UNCERTAIN) | self._free()
        is_open[[*self._constraints.pinned, *self._constraints.kept, *kept]] = False
        noise_sigma = self._model.sensor.noise_sigma
        self.labels = assigned_again(
            tracks, assessed, is_open, self.evidence.ghost, noise_sigma, is_even=is_even
        )

    def _free(self) -> NDArray[np.bool_]:
        """Return which detections have no track, without those that an edit is about.

        If an edit states that one is clutter, its tracklet is too.
        """
        stated = [*self._constraints.clutter, *self._constraints.pinned]
        free, parts = self.labels < 0, self.evidence.part_of
        free[stated] = False
        ghosts = {int(parts[i]) for i in self._constraints.clutter} - {-1}
        if ghosts:  # a part of which some detections are of a track is no ghost
            ghosts -= set(parts[np.isin(parts, list(ghosts)) & (self.labels >= 0)].tolist())
        return free & ~np.isin(parts, list(ghosts)) if ghosts else free


_Solution = tuple[float, list[tuple["NDArray[np.int64]", int]]]
"""Gain, and the detections that go to each track."""
