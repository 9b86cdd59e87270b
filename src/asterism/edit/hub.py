"""One session, many pages: actions one after the other, and what changed for every page."""

from __future__ import annotations

import asyncio
import dataclasses
import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.edit.view import View
from asterism.errors import AsterismError, ParameterError
from asterism.reporting.page import Editing

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Sequence
    from pathlib import Path

    from asterism.edit.messages import Message
    from asterism.edit.session import Session
    from asterism.model import Decision, Edit, Tracks
    from asterism.tracking import Change

__all__ = ["Hub"]

log = logging.getLogger(__name__)

UNCERTAIN = 0.8
"""Probability from which a decision needs no look, as in the report."""
_ASSESSMENTS = 3  # whose decisions can still be chosen
_Event = tuple[str, dict[str, Any]]


class Hub:
    """State that all pages share.

    Parameters
    ----------
    session : Session
        Session that is edited.
    saved : Path
        File to which the page saves.
    overwrite : bool
        Whether an existing file is replaced.
    names : sequence of str
        Names of the marker sets, in their order.
    """

    def __init__(
        self, session: Session, saved: Path, *, overwrite: bool = False, names: Sequence[str] = ()
    ) -> None:
        self.session, self.saved, self._overwrite = session, saved, overwrite
        self.names = tuple(names)
        self._lock = asyncio.Lock()
        self._log: list[dict[str, Any]] = []
        self._changes: dict[int, Change] = {}
        self._offer: tuple[int, Change] | None = None  # preview of an assignment, and its version
        self._readers: set[asyncio.Queue[_Event | None]] = set()
        self._n_undone = 0
        self._names: Sequence[str] = session.tracks.display_names
        self._assessed = session.assessed(session.tracks, session.edits)
        self._decisions: list[tuple[Decision, ...]] = [_uncertain(self._assessed)]
        self._assessment_of = 0
        self._task: asyncio.Task[None] | None = None
        self.view = View(self._assessed)

    async def page(self) -> bytes:
        """Return the page of the tracks as they are now."""
        async with self._lock:
            now, version = self.session.tracks, len(self._log)
        known = self._assessed
        tracks = dataclasses.replace(known, labels=now.labels, names=now.names, decisions=())
        d = now.detections
        title = getattr(getattr(d, "path", None), "name", "Tracks")
        editing = Editing(
            file=self.session.path.name, sha256="", shift=0, is_served=True,
            version=version, names=self.names, saved=self.saved.name,
        )  # fmt: skip
        return await asyncio.to_thread(self.view.page, tracks, editing, title)

    async def act(self, action: str, message: Message) -> dict[str, Any]:
        """Carry out an action; edits are on disk when it returns.

        Raises
        ------
        ParameterError
            If the action is not possible; nothing changed then.
        FormatError
            If a file cannot be written; nothing changed then.
        """
        if action == "preview":
            return await self._preview(message)
        if action == "preview_reassign":
            return await self._preview_reassign(is_even=message["is_even"])
        if action in ("preview_edit", "preview_choose"):
            return await self._preview_edit(action.removeprefix("preview_"), message)
        if action == "save":
            return await self._save()
        async with self._lock:
            change = await asyncio.to_thread(self._change, action, message)
            if change is None:
                raise ParameterError(action, f"an edit to {action}", "none")
            step = {"undo": 1, "redo": -1}.get(action, -self._n_undone)
            self._n_undone += step
            event = self._entry(change, is_new=action != "undo")
        self._send("change", event)
        self._begin_assessment()
        return event

    async def events(self, since: int) -> AsyncGenerator[_Event, None]:
        """Yield the events after a version, then each as it comes, until the server stops."""
        queue: asyncio.Queue[_Event | None] = asyncio.Queue()
        async with self._lock:
            missed = self._log[since:]
            self._readers.add(queue)
        try:
            yield "state", self._state()
            for event in missed:
                yield "change", event
            yield "assessment", self._assessment([], [])
            while (event := await queue.get()) is not None:
                yield event
        finally:
            self._readers.discard(queue)

    def close(self) -> None:
        """End the events of all pages."""
        for queue in self._readers:
            queue.put_nowait(None)

    def _change(self, action: str, message: Message) -> Change | None:
        session = self.session
        if action == "undo":
            return session.undo()
        if action == "redo":
            return session.redo()
        if action == "refuse":
            change = self._changes.get(message["version"])
            if change is None or message["stretch"] >= len(change.stretches):
                raise ParameterError("stretch", "one of the last change", message["stretch"])
            return session.refuse(change, message["stretch"])
        return session.apply(self._edit(action, message))

    def _edit(self, action: str, message: Message) -> Edit:
        session, view = self.session, self.view
        if action == "edit":
            own = [view.detection(i) for i in message["detections"]]
            if message["kind"] == "cut" and len(own) == 2:
                own[0] = self._before(own[1], own[0])
            return session.edit(message["kind"], *own, name=message["name"])
        if action == "reassign":
            if self._offer is None or not self._offer[0] == message["version"] == len(self._log):
                raise ParameterError("version", "that of the last preview", message["version"])
            offered = self._offer[1]
            left_out = offered.of_groups(message["without"]).tolist()
            return session.edit(offered.edit.kind, *left_out)
        if action == "fill":
            return session.fill(*self._gap(message), message["kind"])
        at = self._assessment_of - message["assessment"]
        if not 0 <= at < len(self._decisions):
            raise ParameterError("decision", "one of the last assessment", "an older one")
        decisions = self._decisions[-1 - at]
        if message["decision"] >= len(decisions):
            raise ParameterError("decision", f"a number below {len(decisions)}",
                                 message["decision"])  # fmt: skip
        decision, i = decisions[message["decision"]], message["alternative"]
        if i is not None and i >= len(decision.alternatives):
            raise ParameterError("alternative", f"below {len(decision.alternatives)}", i)
        return session.choose(decision, None if i is None else decision.alternatives[i])

    def _before(self, later: int, shown: int) -> int:
        """Return the detection before a later one in its track, which the page may not show."""
        labels = self.session.tracks.labels
        if labels[shown] != labels[later] or labels[later] < 0 or shown >= later:
            return shown
        return int(np.flatnonzero(labels[:later] == labels[later])[-1])

    def _gap(self, message: Message) -> tuple[int, int, int]:
        """Return track, first and last frame of a gap that the page describes."""
        track = message["track"]
        first, last = (self.view.frame(message[key]) for key in ("first", "last"))
        if track >= self.session.tracks.n_tracks:
            raise ParameterError("track", f"a number below {self.session.tracks.n_tracks}", track)
        frames = self.session.tracks.detections.frame_of[self.session.tracks.labels == track]
        at = int(np.searchsorted(frames, first))
        if not 0 < at < len(frames):
            raise ParameterError("track", f"a gap from {first} to {last}", f"track {track}")
        return track, int(frames[at - 1]) + 1, int(frames[at]) - 1

    async def _preview(self, message: Message) -> dict[str, Any]:
        async with self._lock:
            track, first, last = self._gap(message)
            edit = self.session.fill(track, first, last)
            points, sigma = await asyncio.to_thread(self.session.fill_preview, edit)
        return {
            "track": track, "first": first + self.view.shift, "last": last + self.view.shift,
            "points": np.round(points, 5).tolist(), "sigma": np.round(sigma, 6).tolist(),
        }  # fmt: skip

    async def _preview_edit(self, action: str, message: Message) -> dict[str, Any]:
        async with self._lock:
            edit = self._edit(action, message)
            change = await asyncio.to_thread(self.session.preview, edit)
        return {"stretches": self.view.stretches(change)}

    async def _preview_reassign(self, *, is_even: bool) -> dict[str, Any]:
        async with self._lock:
            edit = self.session.edit("reassign_even" if is_even else "reassign")
            change = await asyncio.to_thread(self.session.preview, edit)
            self._offer = len(self._log), change
        return {"stretches": self.view.stretches(change), "version": self._offer[0]}

    async def _save(self) -> dict[str, Any]:
        async with self._lock:
            await asyncio.to_thread(self.session.save, self.saved, overwrite=self._overwrite)
            self._overwrite = True  # the next time it replaces a file of this session
            event = {"saved": str(self.saved), "version": len(self._log)}
        self._send("saved", event)
        return event

    def _entry(self, change: Change, *, is_new: bool) -> dict[str, Any]:
        tracks = self.session.tracks
        event = self.view.change(change, self._names, tracks, is_new=is_new)
        self._names = tracks.display_names
        event |= {"version": len(self._log) + 1, **self._state()}
        self._log.append(event)
        self._changes = {event["version"]: change} if is_new else {}
        return event

    def _state(self) -> dict[str, Any]:
        edits = self.session.edits
        return {"edits": [self.view.edit(each) for each in edits], "n_undone": self._n_undone}

    def _begin_assessment(self) -> None:
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._assess_until_current())

    async def _assess_until_current(self) -> None:
        while self._assessment_of != len(self._log):
            async with self._lock:
                version = len(self._log)
                tracks, edits = self.session.tracks, self.session.edits
            try:
                found = await asyncio.to_thread(self.session.assessed, tracks, edits)
            except AsterismError as error:
                log.warning("%s", error)
                return
            changed, values = self._changed_confidences(found)
            self._assessed = found
            older = [()] * (version - self._assessment_of - 1)
            self._decisions = [*self._decisions, *older, _uncertain(found)][-_ASSESSMENTS:]
            self._assessment_of = version
            self._send("assessment", self._assessment(changed, values))

    def _changed_confidences(self, found: Tracks) -> tuple[list[int], list[int]]:
        before, now = self._assessed.identity_confidence, found.identity_confidence
        if before is None or now is None:
            return [], []
        level = np.rint(255 * now).astype(np.int64)
        changed = np.flatnonzero(level != np.rint(255 * before).astype(np.int64))
        return self.view.numbers(changed, level[changed])

    def _assessment(self, changed: list[int], values: list[int]) -> dict[str, Any]:
        return {
            "assessment": self._assessment_of,
            "decisions": [self.view.decision(each) for each in self._decisions[-1]],
            "detections": changed,
            "confidences": values,
        }

    def _send(self, kind: str, event: dict[str, Any]) -> None:
        for queue in self._readers:
            queue.put_nowait((kind, event))


def _uncertain(tracks: Tracks) -> tuple[Decision, ...]:
    """Return the uncertain identities and names, by falling expected wrong detections."""
    found = [
        each
        for each in tracks.decisions
        if each.probability is not None and each.probability < UNCERTAIN and each.track >= 0
        and each.kind in ("identity", "name")
    ]  # fmt: skip
    return tuple(sorted(found, key=lambda each: -each.expected_wrong))
