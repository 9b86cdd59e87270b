"""What the page of the editor shows: its frames, and changes and decisions as plain values."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError
from asterism.reporting.gather import contents_of
from asterism.reporting.page import Editing, page
from asterism.reporting.page.thinning import frames_to_show
from asterism.reporting.places import places_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Decision, Edit, Tracks
    from asterism.tracking import Change

__all__ = ["View"]


class View:
    """Frames and detections of the page, by which the page and the server refer to them.

    A page numbers the detections of its own frames. A capture of more than three million points
    is shown in part, and detections of other frames are not sent.

    Parameters
    ----------
    tracks : Tracks
        Assessed tracks, whose uncertain places are shown in all frames.
    """

    def __init__(self, tracks: Tracks) -> None:
        d = tracks.detections
        self.frames = frames_to_show(tracks, places_of(tracks))
        is_shown = np.zeros(d.n_frames, dtype=bool)
        is_shown[self.frames] = True
        self._kept = np.flatnonzero(is_shown[d.frame_of])
        self._is_whole = len(self._kept) == d.n_points
        self.shift = getattr(d, "first_frame", 0)

    def page(self, tracks: Tracks, editing: Editing, title: str) -> bytes:
        """Return the page of tracks."""
        contents = contents_of(dataclasses.replace(tracks, decisions=()), title=title)
        return page(dataclasses.replace(contents, editing=editing, places=None), shown=self.frames)

    def detection(self, number: int) -> int:
        """Return a detection of the capture from its number on the page."""
        if number >= len(self._kept):
            raise ParameterError("detections", f"numbers below {len(self._kept)}", number)
        return int(self._kept[number])

    def frame(self, number: int) -> int:
        """Return a frame of the capture from its number on the page."""
        if number >= len(self.frames):
            raise ParameterError("frame", f"a number below {len(self.frames)}", number)
        return int(self.frames[number])

    def shown_frame(self, frame: int) -> int:
        """Return the frame of the page at or after a frame of the capture."""
        return min(int(np.searchsorted(self.frames, frame)), len(self.frames) - 1)

    def numbers(
        self, detections: NDArray[np.int64], values: NDArray[Any]
    ) -> tuple[list[int], list[Any]]:
        """Return the numbers on the page of detections, and their values, without hidden ones."""
        if self._is_whole:
            return detections.tolist(), values.tolist()
        at = np.minimum(np.searchsorted(self._kept, detections), len(self._kept) - 1)
        is_on = self._kept[at] == detections
        return at[is_on].tolist(), values[is_on].tolist()

    def change(
        self, change: Change, before: Sequence[str], tracks: Tracks, *, is_new: bool
    ) -> dict[str, Any]:
        """Return a change as plain values.

        Parameters
        ----------
        change : Change
            What an edit changed.
        before : sequence of str
            Display names of the tracks before it.
        tracks : Tracks
            Tracks after it.
        is_new : bool
            Whether the edit was made, and not taken back.
        """
        names = tracks.display_names
        numbers, labels = self.numbers(change.detections, tracks.labels[change.detections])
        return {
            "edit": self.edit(change.edit),
            "is_new": is_new,
            "detections": numbers,
            "labels": labels,
            "names": {
                str(k): name
                for k, name in enumerate(names)
                if k >= len(before) or name != before[k]
            },
            "stretches": self.stretches(change) if is_new else [],
        }

    def stretches(self, change: Change) -> list[dict[str, Any]]:
        """Return the stretches of a change as plain values."""
        return [
            {
                **dataclasses.asdict(stretch),
                "at": self.shown_frame(stretch.first),
                "end": self.shown_frame(stretch.last),
                "first": stretch.first + self.shift,
                "last": stretch.last + self.shift,
            }
            for stretch in change.stretches
        ]

    def edit(self, edit: Edit) -> dict[str, Any]:
        """Return an edit as plain values, with the frame numbers of the capture."""
        at = [[frame + self.shift, point] for frame, point in edit.at]
        return {"kind": edit.kind, "at": at, "name": edit.name, "who": edit.who}

    def decision(self, decision: Decision) -> dict[str, Any]:
        """Return a decision as plain values."""
        likely = sorted(enumerate(decision.alternatives), key=lambda one: -one[1].probability)
        return {
            "kind": decision.kind,
            "track": decision.track,
            "at": self.shown_frame(decision.first),
            "end": self.shown_frame(decision.last),
            "first": decision.first + self.shift,
            "last": decision.last + self.shift,
            "n_detections": decision.n_detections,
            "probability": decision.probability,
            "name": decision.name,
            "alternatives": [
                {"i": i, "track": each.track, "probability": each.probability, "name": each.name}
                for i, each in likely
            ],
        }
