"""Editor of the page: its panel, its keys, and the numbers of the detections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.model import Capture
from asterism.model.recipe import sha256_of
from asterism.reporting.page.contents import Editing
from asterism.reporting.page.markup import Markup, element

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections
    from asterism.reporting.page.contents import Contents

__all__ = ["PANEL", "editing_keys", "editing_of", "numbers_of", "tile"]

_KEYS = {
    "N, P": "next and previous uncertain decision",
    "1 … 9": "choose the answer with that number; leave out that change of a preview",
    "X": "exchange two selected tracks from this frame on",
    "H, Shift H": "exchange two tracks in this frame alone; mark the frame from which it begins, "
    "or at which a track is a different marker",
    "J, Shift J": "join two selected tracks, or a point and a track; they are different markers",
    "U": "select the next point of clutter in this frame",
    "E": "keep the selected track, to select a second one",
    "O": "lasso: draw around markers to select them",
    "C, Shift C": "cut the track: from this frame on, up to this frame",
    "V": "cut out the part without gaps at this frame",
    "I": "give a name; Enter confirms, Esc leaves the field",
    "K": "delete the selected part: it is a ghost",
    "G, Shift G": "preview the fill of the gap at this frame; leave that gap open",
    "Q": "preview each answer and correction before it is made",
    "Enter": "confirm the preview",
    "T, Shift T": "preview an assignment of all uncertain points; the same at even odds",
    "Z, Y": "undo, redo",
    "R": "take back the first of the other changes",
    "B": "save",
    "?": "list of keys",
}
_SERVED = ("1 … 9", "G, Shift G", "Q", "Enter", "T, Shift T", "Z, Y", "R", "B")


def editing_of(detections: Detections, file: str) -> Editing:
    """Return what an editor needs that collects edits without a server.

    Parameters
    ----------
    detections : Detections
        Detections of the page.
    file : str
        Name of the file that is downloaded.
    """
    shift = 0 if isinstance(detections, Capture) else 1  # as the file numbers the frames
    return Editing(file=file, sha256=sha256_of(detections), shift=shift)


def editing_keys(contents: Contents) -> dict[str, str]:
    """Return the keys of the editor and what they do."""
    if contents.editing is None:
        return {}
    if contents.editing.is_served:
        return _KEYS
    kept = {keys: what for keys, what in _KEYS.items() if keys not in _SERVED}
    return kept | {"Z": "take back the last edit", "B": "download the edits"}


def numbers_of(d: Detections, rows: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    """Return the number of points of each frame, and the number of each drawn point in its frame.

    Parameters
    ----------
    d : Detections
        Detections of the shown frames.
    rows : ndarray of int
        Drawn detections, in the order of the player.
    """
    point = rows - d.offsets[d.frame_of[rows]]
    kind = np.uint16 if d.counts.max(initial=0) < 2**16 else np.uint32
    return {"counts": d.counts.astype(np.uint32), "point": point.astype(kind)}


def tile() -> Markup:
    """Return the number of uncertain decisions, which the editor keeps up to date."""
    return element(
        "div",
        element("dt", "uncertain decisions", id="uncertain-about"),
        element("dd", "–", id="uncertain", data_fact="uncertain"),
        class_="to-check",
        data_severity="none",
        id="uncertain-tile",
    )


def _button(name: str, text: str, key: str, label: str) -> Markup:
    return element(
        "button", text, element("kbd", key), type="button", id=name,
        aria_keyshortcuts=key.replace("⇧", "Shift+"), title=label, aria_label=label,
    )  # fmt: skip


PANEL = element(
    "div",
    element(
        "div",
        element("h3", "Correct"),
        element("output", "", id="edit-state", aria_live="polite"),
        _button("edit-undo", "Undo", "Z", "Undo the last edit"),
        _button("edit-redo", "Redo", "Y", "Redo the edit"),
        class_="edit-head",
    ),
    element("div", id="decision", role="group", aria_label="Uncertain decision"),
    element("div", id="changed", role="status"),
    element("p", id="edit-error", role="alert", hidden=True),
    element(
        "div",
        element("p", "Select a marker to correct it.", id="selection", class_="quiet"),
        element(
            "div",
            _button("edit-swap", "Exchange", "X", "Exchange two tracks from this frame on"),
            _button("edit-here", "Exchange here", "H", "Exchange in this frame or from the mark"),
            _button("edit-mark", "Mark", "⇧H", "Mark the frame of an exchange or a difference"),
            _button("edit-join", "Join", "J", "Join two tracks"),
            _button("edit-apart", "Different", "⇧J", "Both are different markers"),
            _button("edit-ghost", "Ghost", "K", "Delete the part: it is a ghost"),
            _button("edit-cut", "Cut from here", "C", "Cut the track from this frame on"),
            _button("edit-cut-back", "Cut to here", "⇧C", "Cut the track up to this frame"),
            _button("edit-cut-whole", "Cut out", "V", "Cut out the part without gaps"),
            _button("edit-fill", "Fill gap", "G", "Preview the fill of the gap at this frame"),
            _button("edit-open", "Leave open", "⇧G", "Leave the gap at this frame open"),
            _button("edit-ahead", "Preview first", "Q", "Preview edits before they are made"),
            _button("edit-reassign", "Assign again", "T", "Preview an assignment of all points"),
            _button("edit-reassign-even", "At even odds", "⇧T", "Preview it at even odds"),
            _button("edit-keep", "Add", "E", "Keep the track and select a second one"),
            _button("edit-lasso", "Lasso", "O", "Draw around markers to select them"),
            class_="tools",
        ),
        element(
            "form",
            element("label", "Name", for_="edit-name"),
            element(
                "input", id="edit-name", list="edit-names", autocomplete="off", spellcheck="false",
                aria_keyshortcuts="I", maxlength=200,
            ),
            element("datalist", id="edit-names"),
            element("button", "Give", type="submit", id="edit-give"),
            id="edit-naming",
        ),
        element("div", id="filling", role="group", aria_label="Preview"),
        role="group",
        aria_label="Corrections",
    ),
    element(
        "div",
        _button("edit-save", "Save", "B", "Save the result"),
        _button("edit-keys", "Keys", "?", "List of keys"),
        class_="tools",
    ),
    element("p", id="edit-saved", class_="quiet", role="status"),
    element(
        "details",
        element("summary", "Edits"),
        element("ol", id="edit-list"),
        class_="others",
    ),
    id="editor",
)  # fmt: skip
"""The panel; the editor fills it."""
