"""Constraints that edits put on the tracks: which detections are of one marker, which are not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.errors import ParameterError
from asterism.model import Capture
from asterism.model.edit import REASSIGN

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from asterism.model import Detections, Edit

__all__ = ["Constraints", "detections_of", "in_words"]


def detections_of(edit: Edit, detections: Detections) -> tuple[int, ...]:
    """Return the indices of the detections of an edit.

    Parameters
    ----------
    edit : Edit
        Edit of these detections.
    detections : Detections
        Detections to which it refers.

    Raises
    ------
    ParameterError
        If there is no such frame or point.
    """
    found: list[int] = []
    for frame, point in edit.at:
        if frame >= detections.n_frames or point >= detections.counts[frame]:
            expected = f"a detection of {detections.n_frames} frames"
            raise ParameterError("edits", expected, in_words(edit, detections))
        found.append(int(detections.offsets[frame]) + point)
    return tuple(found)


def in_words(edit: Edit, detections: Detections) -> str:
    """Return an edit in words; the frames of a capture also as its file numbers them."""
    words = repr(edit)[5:-1]
    if not edit.at or not isinstance(detections, Capture):
        return words
    frames = ", ".join(str(detections.first_frame + frame) for frame, _ in edit.at)
    return f"{words} (frame {frames} of the file)"


class Constraints:
    """Groups of detections of one marker, and pairs of groups of different markers.

    Parameters
    ----------
    detections : Detections
        Detections to which the edits refer.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.model import Edit
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> found = Constraints(d)
    >>> found.add(Edit(kind="same", at=((0, 0), (5, 0))))
    >>> found.group(d.offsets[5] + 0) == {0, d.offsets[5]}
    True
    >>> found.add(Edit(kind="different", at=((0, 0), (5, 0))))
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: edits: expected statements that agree, found different: frame 0
    point 0, frame 5 point 0, which contradicts same: frame 0 point 0, frame 5 point 0. Undo one of
    them.
    """

    def __init__(self, detections: Detections) -> None:
        self.detections = detections
        self.edits: tuple[Edit, ...] = ()
        self._root: dict[int, int] = {}
        self._groups: dict[int, set[int]] = {}
        self._apart: dict[tuple[int, int], Edit] = {}
        self._clutter: dict[int, Edit] = {}
        self._names: dict[str, int] = {}
        self._kept: set[int] = set()

    @classmethod
    def of(cls, edits: Iterable[Edit], detections: Detections) -> Constraints:
        """Return the constraints of several edits.

        Parameters
        ----------
        edits : iterable of Edit
            Edits in their order.
        detections : Detections
            Detections to which they refer.

        Raises
        ------
        ParameterError
            If two edits contradict each other.
        """
        found = cls(detections)
        for edit in edits:
            found.add(edit)
        return found

    @property
    def pinned(self) -> frozenset[int]:
        """Detections whose identity is stated, without clutter."""
        return frozenset(self._root)

    @property
    def clutter(self) -> frozenset[int]:
        """Detections that are clutter."""
        return frozenset(self._clutter)

    @property
    def kept(self) -> frozenset[int]:
        """Detections that no assignment of all uncertain ones changes."""
        return frozenset(self._kept)

    @property
    def named(self) -> dict[str, int]:
        """One detection of each named marker."""
        return dict(self._names)

    def group(self, detection: int) -> set[int]:
        """Return all detections that are of the marker of a detection, itself included."""
        return self._groups.get(self._root.get(detection, -1), {detection})

    def name(self, detection: int) -> str:
        """Return the stated name of the marker of a detection, empty without one."""
        own = self.group(detection)
        return next((name for name, one in self._names.items() if one in own), "")

    def are_different(self, one: int, other: int) -> bool:
        """Return whether two detections are stated to be of different markers."""
        return self._why_apart(self.group(one), self.group(other)) is not None

    def add(self, edit: Edit) -> None:
        """Add the constraint of an edit.

        Parameters
        ----------
        edit : Edit
            Next edit. Nothing changes if it contradicts the earlier ones.

        Raises
        ------
        ParameterError
            If it contradicts an earlier edit.
        """
        own = detections_of(edit, self.detections)
        if edit.kind in ("same", "only"):
            self._join(own[0], own[1], edit)
        elif edit.kind in ("different", "cut"):
            self._part(own[0], own[1], edit)
        elif edit.kind == "name":
            self._call(own[0], edit)
        elif edit.kind == "clutter":
            if own[0] in self._root:
                self._refuse(edit, self._about(own[0]))
            self._clutter[own[0]] = edit
        elif edit.kind in REASSIGN:
            self._kept.update(own)
        self.edits += (edit,)

    def _join(self, one: int, other: int, edit: Edit) -> None:
        self._check_measured((one, other), edit)
        first, second = self.group(one), self.group(other)
        if first is second or other in first:
            self._enter(one)
            return
        if (why := self._why_apart(first, second)) is not None:
            self._refuse(edit, why)
        frame = self.detections.frame_of
        if shared := {frame[i] for i in first} & {frame[i] for i in second}:
            at = next(i for i in first if frame[i] in shared)
            self._refuse(edit, self._about(at), "two detections of one frame would be one marker")
        root = self._enter(one)
        for i in self.group(other):
            self._root[i] = root
        self._groups[root] = first | second

    def _part(self, one: int, other: int, edit: Edit) -> None:
        self._check_measured((one, other), edit)
        if other in self.group(one):
            self._refuse(edit, self._about(one))
        self._enter(one)
        self._enter(other)
        self._apart[one, other] = edit

    def _call(self, one: int, edit: Edit) -> None:
        self._check_measured((one,), edit)
        if (name := self.name(one)) and name != edit.name:
            self._refuse(edit, self._about(self._names[name]))
        other = self._names.get(edit.name, one)
        self._join(one, other, edit)
        self._names.setdefault(edit.name, one)

    def _enter(self, detection: int) -> int:
        root = self._root.setdefault(detection, detection)
        self._groups.setdefault(root, {detection})
        return root

    def _why_apart(self, first: set[int], second: set[int]) -> Edit | None:
        for (one, other), edit in self._apart.items():
            if (one in first and other in second) or (other in first and one in second):
                return edit
        names = [name for name, one in self._names.items() if one in first or one in second]
        return self._about(self._names[names[0]]) if len(names) > 1 else None

    def _check_measured(self, own: Sequence[int], edit: Edit) -> None:
        for each in own:
            if each in self._clutter:
                self._refuse(edit, self._clutter[each])

    def _about(self, detection: int) -> Edit | None:
        frame = int(self.detections.frame_of[detection])
        at = (frame, detection - int(self.detections.offsets[frame]))
        return next((each for each in reversed(self.edits) if at in each.at), None)

    def _refuse(self, edit: Edit, other: Edit | None, why: str = "") -> None:
        earlier = "an earlier one" if other is None else in_words(other, self.detections)
        found = f"{in_words(edit, self.detections)}, which contradicts {earlier}"
        raise ParameterError(
            "edits", "statements that agree", f"{found}{f': {why}' * bool(why)}", "undo one of them"
        )
