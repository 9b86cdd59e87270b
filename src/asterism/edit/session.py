"""Session of a person who corrects the tracks of a capture, edit by edit."""

from __future__ import annotations

import dataclasses
import datetime
from typing import TYPE_CHECKING, Self

import numpy as np

from asterism.checks import check_kind, check_path
from asterism.errors import FormatError, ParameterError
from asterism.io import read_edits, write, write_edits
from asterism.model import Decision, Detections, Edit, Recipe
from asterism.model.recipe import sha256_of
from asterism.tracking import Correction, Tracked, fill_gaps, plan_tracking
from asterism.tracking.correction import settled
from asterism.tracking.estimation import model_of
from asterism.tracking.pipeline import conclude, without_edits

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from typing import Any

    from numpy.typing import NDArray

    from asterism.model import Alternative, MarkerSet, Tracks
    from asterism.tracking import Change
    from asterism.tracking.attempts.uncorrected import Uncorrected

__all__ = ["Session"]


class Session:
    """Tracks under correction, with a file that holds every edit before it is confirmed.

    Parameters
    ----------
    begun : Uncorrected
        Result of a recipe before any edit.
    path : Path
        File of the edits.
    who : str
        Person who makes the edits.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> d = am.simulate.cube(frames=40, seed=1).detections
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     session = am.edit.Session.open(d, f"{folder}/trial.edits.toml", who="Ada")
    ...     change = session.apply(session.edit("clutter", 0))
    ...     len(am.edit.Session.open(d, f"{folder}/trial.edits.toml").edits)
    1
    """

    def __init__(self, begun: Uncorrected, path: Path, who: str = "") -> None:
        self.begun, self.path, self.who = begun, path, who
        self._correction = Correction(begun.as_modelled(begun.tracks), begun.model, begun.stitching)
        self._undone: list[Edit] = []
        self._sha256 = sha256_of(begun.tracks.detections)

    @classmethod
    def open(
        cls,
        detections: Detections,
        path: str | Path,
        recipe: Recipe | None = None,
        *,
        marker_sets: Sequence[MarkerSet] | None = None,
        who: str = "",
        progress: Callable[[int], Any] | None = None,
    ) -> Self:
        """Track a capture, and take up the edits of a file where it exists.

        Parameters
        ----------
        detections : Detections
            Points to track.
        path : path
            File of the edits, which need not exist.
        recipe : Recipe, optional
            Settings of the tracking; by default those that `plan_tracking` selects.
        marker_sets : sequence of MarkerSet, optional
            Marker sets that name the tracks, as for `track`.
        who : str
            Person who makes the edits.
        progress : callable, optional
            Called from time to time with the number of tracked frames.

        Returns
        -------
        Session

        Raises
        ------
        FormatError
            If the file of the edits is malformed or belongs to other detections.
        ParameterError
            If its edits contradict each other.
        """
        check_kind("detections", detections, Detections, "am.read(path)")
        path = check_path("path", path)
        edits = read_edits(path, detections) if path.exists() else ()
        if recipe is None:
            recipe = plan_tracking(detections, marker_sets=marker_sets).recipe
        recipe = dataclasses.replace(recipe, edits="")
        begun = without_edits(recipe, detections, marker_sets=marker_sets, progress=progress)
        session = cls(begun, path, who)
        for edit in edits:
            session._correction.apply(edit)
        return session

    def __repr__(self) -> str:
        return f"Session({self.tracks.n_tracks} tracks, {len(self.edits)} edits)"

    @property
    def tracks(self) -> Tracks:
        """Tracks now; numbers stay the same, and emptied tracks have no detection."""
        return self.begun.as_captured(self._correction.tracks)

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Edits that hold now, in their order."""
        return self._correction.edits

    def edit(self, kind: Any, *detections: int, name: str = "") -> Edit:
        """Return an edit of this person at this time.

        Parameters
        ----------
        kind : str
            Kind of the edit, as for `Edit`.
        *detections : int
            Indices of its detections.
        name : str
            Name of a marker.
        """
        d = self.tracks.detections
        for i in detections:
            if not 0 <= i < d.n_points:
                raise ParameterError("detections", f"indices below {d.n_points}", i)
        frames = [int(d.frame_of[i]) for i in detections]
        at = tuple((t, int(i - d.offsets[t])) for i, t in zip(detections, frames, strict=True))
        when = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return Edit(kind=kind, at=at, name=name, who=self.who, when=when)

    def apply(self, edit: Edit) -> Change:
        """Change the tracks by an edit, and write it to the file.

        Parameters
        ----------
        edit : Edit
            Next edit.

        Returns
        -------
        Change
            What changed; the edit is on disk.

        Raises
        ------
        ParameterError
            If it contradicts earlier edits; nothing changes then.
        FormatError
            If the file cannot be written; nothing changes then.
        """
        change = self._correction.apply(edit)
        try:
            self._write(self.edits)
        except FormatError:
            self._correction.undo()
            raise
        self._undone.clear()
        return change

    def preview(self, edit: Edit) -> Change:
        """Return what an edit would change; the tracks and the file stay as they are.

        Parameters
        ----------
        edit : Edit
            Edit that is not made.

        Raises
        ------
        ParameterError
            If it contradicts earlier edits.
        """
        change = self._correction.apply(edit)
        self._correction.undo()
        return change

    def undo(self) -> Change | None:
        """Take back the last edit, and return what it had changed; None without one."""
        if not (edits := self.edits):
            return None
        self._write(edits[:-1])
        self._undone.append(edits[-1])
        return self._correction.undo()

    def redo(self) -> Change | None:
        """Make the last edit again that was taken back; None without one."""
        if not self._undone:
            return None
        undone = self._undone.copy()
        change = self.apply(undone[-1])
        self._undone = undone[:-1]
        return change

    def refuse(self, change: Change, i: int) -> Change:
        """Take back one of the stretches that followed from an edit, by a further edit.

        Where its former track now has the detections of the edit at that time, the stretch cannot
        return to it; it is then stated to be of another marker than its new track. Detections that
        had no track become clutter.

        Parameters
        ----------
        change : Change
            Last change.
        i : int
            Number of a stretch that was not asked for.

        Returns
        -------
        Change
            What changed.

        Raises
        ------
        ParameterError
            If the stretch was asked for, or its former track has no other detection.
        """
        stretch = change.stretches[i]
        if stretch.is_asked:
            hint = "undo the edit instead"
            raise ParameterError("i", "a stretch that followed from the edit", i, hint)
        own = change.detections[change.stretch_of == i]
        middle = int(own[len(own) // 2])
        is_taken = any(
            each.is_asked and each.target == stretch.source and each.first <= stretch.last
            and each.last >= stretch.first
            for each in change.stretches
        )  # fmt: skip
        if stretch.source < 0:
            return self.apply(self.edit("clutter", middle))
        anchor = None if is_taken else self._anchor(stretch.source, middle)
        if anchor is None:
            return self.apply(self.edit("different", middle, self._other(stretch.target, own)))
        return self.apply(self.edit("same", anchor, middle))

    def choose(self, decision: Decision, alternative: Alternative | None = None) -> Edit:
        """Return the edit by which an uncertain part is of an alternative's marker.

        Parameters
        ----------
        decision : Decision
            Uncertain identity or name.
        alternative : Alternative, optional
            One of its alternatives; None if the decision is right.

        Returns
        -------
        Edit

        Raises
        ------
        ParameterError
            If there is no detection to which it could refer.
        """
        labels, frame = self.tracks.labels, self.tracks.detections.frame_of
        own = np.flatnonzero(labels == decision.track)
        inside = own[(frame[own] >= decision.first) & (frame[own] <= decision.last)]
        if not len(inside):
            raise ParameterError("decision", "one about the tracks now", decision)
        middle = int(inside[len(inside) // 2])
        name = decision.name if alternative is None else alternative.name
        if decision.kind == "name" and name:
            return self.edit("name", middle, name=name)
        track = decision.track if alternative is None else alternative.track
        anchor = None if track is None else self._anchor(track, middle, inside)
        if anchor is not None:
            return self.edit("same", anchor, middle)
        outside = np.setdiff1d(own, inside)
        if alternative is None or not len(outside):
            return self.edit("name", middle, name=self.tracks.display_names[decision.track])
        return self.edit("different", self._other(decision.track, inside), middle)

    def decisions(self) -> tuple[Decision, ...]:
        """Return the uncertain identities and names, by falling expected wrong detections."""
        found = self.assessed(self.tracks, self.edits).decisions
        return tuple(sorted(found, key=lambda each: -each.expected_wrong))

    def assessed(self, tracks: Tracks, edits: Sequence[Edit]) -> Tracks:
        """Return tracks of the session with the confidence of their identities.

        Parameters
        ----------
        tracks : Tracks
            Tracks at some time.
        edits : sequence of Edit
            Edits that held then.
        """
        return settled(dataclasses.replace(self.begun, tracks=tracks).assessed, edits)

    def fill_preview(self, edit: Edit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the positions by which a gap would be filled, and their standard deviations.

        Parameters
        ----------
        edit : Edit
            Edit that fills the gap, as of `fill`.

        Returns
        -------
        positions : ndarray of shape (n, 3)
            Metres.
        sigma : ndarray of shape (n,)
            Standard deviation of a coordinate, metres.
        """
        model = model_of(self.tracks, self.begun.recipe)
        d = fill_gaps(self.tracks, model=model, longest=0.0, edits=(edit,)).tracks.detections
        if d.filled is None or d.stds is None:
            raise ParameterError("edit", "one that fills a gap", edit)
        return d.points[d.filled], d.stds[d.filled]

    def fill(self, track: int, first: int, last: int, kind: Any = "fill") -> Edit:
        """Return the edit that fills a gap, or leaves it open.

        Parameters
        ----------
        track : int
            Track with the gap.
        first, last : int
            First and last frame of the gap.
        kind : {"fill", "no_fill"}
            Kind of the edit.

        Raises
        ------
        ParameterError
            If the track has no such gap.
        """
        own = np.flatnonzero(self.tracks.labels == track)
        frame = self.tracks.detections.frame_of[own]
        at = int(np.searchsorted(frame, first))
        if not 0 < at < len(own) or (frame[at - 1], frame[at]) != (first - 1, last + 1):
            raise ParameterError("track", f"a gap from {first} to {last}", f"track {track}")
        return self.edit(kind, int(own[at - 1]), int(own[at]))

    def _write(self, edits: Sequence[Edit]) -> None:
        write_edits(self.path, edits, self.begun.tracks.detections, sha256=self._sha256)

    def result(self) -> Tracked:
        """Return what ``am.track`` returns for these edits."""
        return conclude(self.begun, self.edits)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the corrected tracks, never over the input.

        Parameters
        ----------
        path : path
            File to write, in the format of its name.
        overwrite : bool
            Whether an existing file is replaced.

        Raises
        ------
        FormatError
            If the file is the input, exists, or cannot be written.
        """
        path = check_path("path", path)
        source = getattr(self.tracks.detections, "path", None)
        if source is not None and path.resolve() == check_path("path", source).resolve():
            raise FormatError(path, "", "another file than the input", "the input")
        if path.exists() and not overwrite:
            raise FormatError(path, "", "no such file", "one", "choose another name, or overwrite")
        write(self.result().tracks, path)

    def _anchor(
        self, track: int, detection: int, without: NDArray[np.int64] | None = None
    ) -> int | None:
        """Return the detection that stands for the marker of a track; stated ones first."""
        frame = self.tracks.detections.frame_of
        own = np.flatnonzero(self.tracks.labels == track)
        own = own[frame[own] != frame[detection]]
        own = own if without is None else np.setdiff1d(own, without)
        if not len(own):
            return None
        stated = np.intersect1d(own, list(self._correction.constraints.pinned)).astype(np.int64)
        return self._correction.anchor(stated if len(stated) else own)

    def _other(self, track: int, without: NDArray[np.int64]) -> int:
        own = np.setdiff1d(np.flatnonzero(self.tracks.labels == track), without)
        if not len(own):
            raise ParameterError("track", "other detections of it", f"none of track {track}")
        return int(own[len(own) // 2])
