"""Correction of tracks by edits: the most probable tracks that respect what a person states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Edit, TrackingModel, Tracks
from asterism.tracking.correction.change import Change, change_of
from asterism.tracking.correction.constraints import Constraints, detections_of, in_words
from asterism.tracking.correction.solver import NoSolution, Solver

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.stitching import Stitching

__all__ = ["Correction"]


class Correction:
    """Tracks under correction; each edit changes only what depends on it.

    An edit states that a part of a track is of the marker of another track, or is not of its own.
    Tracks of one marker that share hardly a frame are joined as a whole. Two other tracks are
    exchanged in intervals of time, of which one holds the part. They are chosen so that the log
    posterior is largest: the distances to other markers of what is exchanged, and the links that
    are cut, as in the identity confidence (`assess`). Detections of earlier edits stay. A track
    whose marker is stated also takes the detections without a track that are probably of it.

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
    (Stretch(first=0, last=39, source=0, target=-1, n_detections=40, is_asked=True, group=0),)
    >>> correction.undo().edit == change.edit, correction.undo() is None
    (True, True)
    """

    def __init__(
        self, tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None
    ) -> None:
        check_kind("tracks", tracks, Tracks, "am.track(detections)")
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
        self._tracks, self._d = tracks, tracks.detections
        self._solver = Solver(tracks, model, stitching)
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
                detections=self._d, labels=self._solver.labels, names=tuple(self._solver.names),
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
            If it contradicts earlier edits, has no solution, or is a cut between detections of a
            track that do not follow each other; nothing changes then.
        """
        check_kind("edit", edit, Edit, 'Edit(kind="same", at=((10, 3), (48, 0)))')
        constraints = Constraints.of((*self.edits, edit), self._d)
        if edit.kind == "cut":
            self._check_cut(edit)
        solver = self._solver
        labels, names = solver.labels.copy(), list(solver.names)
        try:
            solver.solve(edit, self._constraints)
        except NoSolution as error:
            solver.labels, solver.names = labels, names
            hint = "undo an edit in the way, or cut the track there first"
            raise ParameterError(
                "edits", "a solution that respects the earlier edits",
                f"none for {in_words(edit, self._d)}", hint,
            ) from error  # fmt: skip
        change = change_of(
            edit, detections_of(edit, self._d), self._d.frame_of, (labels, solver.labels),
            (names, solver.names),
        )  # fmt: skip
        self._done.append((change, self._constraints, len(names)))
        self._now = None
        self._constraints = constraints
        return change

    def _check_cut(self, edit: Edit) -> None:
        """Raise if a track has other detections between both of a cut.

        A cut of detections that are on different tracks already is respected.
        """
        labels, d = self._solver.labels, self._d
        first, last = sorted(detections_of(edit, d))
        between = np.flatnonzero(labels[first:last] == labels[last])[1:] + first
        if labels[first] < 0 or labels[first] != labels[last] or not len(between):
            return
        frames = [int(d.frame_of[i]) for i in (between[-1], last)]
        points = [int(i - d.offsets[t]) for i, t in zip((between[-1], last), frames, strict=True)]
        nearest = Edit(kind="cut", at=tuple(zip(frames, points, strict=True)))
        name = self.tracks.display_names[labels[last]]
        raise ParameterError(
            "edits", "a cut between detections that follow each other in their track",
            f"{in_words(edit, d)}, with {len(between)} of {name} between them",
            f"state {in_words(nearest, d)}, or different instead of cut",
        )  # fmt: skip

    def anchor(self, candidates: NDArray[np.int64]) -> int:
        """Return the detection that stands best for the marker of a track.

        It is the middle of the longest part without an uncertain link. A detection that is merely
        near in time may be in a part that is on a wrong track too.

        Parameters
        ----------
        candidates : ndarray of int
            Detections of one track to select from, rising; at least one.
        """
        parts = self._solver.evidence.part_of[candidates]
        own = candidates[parts == np.bincount(parts + 1).argmax() - 1]
        return int(own[len(own) // 2])

    def undo(self) -> Change | None:
        """Take back the last edit, and return what it had changed; None without one."""
        if not self._done:
            return None
        change, self._constraints, n = self._done.pop()
        self._solver.labels[change.detections] = change.before
        self._now = None
        names = self._solver.names
        del names[n:]
        for track, (before, _) in change.names.items():
            if track < n:
                names[track] = before
        return change
