"""Edits of a person in a TOML file, which can be read, compared and merged by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.checks import check_fields, check_path
from asterism.errors import FormatError, ParameterError
from asterism.io.atomic import write_text
from asterism.model import Capture, Edit
from asterism.model.recipe import sha256_of
from asterism.model.toml_file import read_toml

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from asterism.model import Detections

__all__ = ["read_edits", "write_edits"]

HEAD = """\
# Statements about detections, in the order in which they were made. Frames are numbered as in the
# capture, and the points of a frame from 0. The edits of several files of one capture can be put
# into one file, below each other.
"""


def read_edits(path: str | Path, detections: Detections) -> tuple[Edit, ...]:
    """Read the edits of a capture.

    Parameters
    ----------
    path : path
        File that `write_edits` wrote, or one written by hand.
    detections : Detections
        Detections to which the edits refer.

    Returns
    -------
    tuple of Edit
        Edits in the order of the file.

    Raises
    ------
    FormatError
        If the file does not exist or is malformed, or its edits belong to other detections.

    Examples
    --------
    >>> import asterism as am, tempfile
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> edits = (am.model.Edit(kind="same", at=((3, 0), (9, 2)), who="Ada"),)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_edits(f"{folder}/trial.edits.toml", edits, d)
    ...     read_edits(f"{folder}/trial.edits.toml", d)
    (Edit(same: frame 3 point 0, frame 9 point 2),)
    """
    values = read_toml(path, "edits")
    try:
        check_fields("edits", values, ("sha256", "edit"))
    except ParameterError as error:
        raise FormatError(path, "the file", "the keys sha256 and edit", str(error)) from error
    found, expected = values.get("sha256", ""), sha256_of(detections)
    if found != expected:
        hint = "edit the capture to which the edits belong, or keep them and start a new file"
        raise FormatError(path, "sha256", f"{expected} of the capture", repr(found), hint)
    each = values.get("edit", [])
    if not isinstance(each, list):
        raise FormatError(path, "edit", "tables [[edit]]", repr(each))
    shift = detections.first_frame if isinstance(detections, Capture) else 1
    edits: list[Edit] = []
    for i, one in enumerate(each, start=1):
        try:
            edits.append(_edit(one, shift, detections))
        except ParameterError as error:
            raise FormatError(path, f"edit {i}", "an edit of this capture", str(error)) from error
    return tuple(edits)


def write_edits(
    path: str | Path, edits: Sequence[Edit], detections: Detections, *, sha256: str = ""
) -> None:
    """Write edits to a file, completely or not at all.

    Parameters
    ----------
    path : path
        File to create or replace.
    edits : sequence of Edit
        Edits, in their order.
    detections : Detections
        Detections to which they refer; their SHA-256 is in the file.
    sha256 : str
        That SHA-256, where it is known already; it takes 10 ms for 500 000 points.

    Raises
    ------
    FormatError
        If the file cannot be written.
    """
    shift = detections.first_frame if isinstance(detections, Capture) else 1
    lines = [HEAD, f'sha256 = "{sha256 or sha256_of(detections)}"\n']
    for edit in edits:
        places = ", ".join(f"[{frame + shift}, {point}]" for frame, point in edit.at)
        lines.append(f'\n[[edit]]\nkind = "{edit.kind}"\nat = [{places}]\n')
        lines += [
            f"{key} = {_text(value)}\n"
            for key in ("name", "who", "when")
            if (value := getattr(edit, key))
        ]
    write_text(check_path("path", path), "".join(lines))


def _text(value: str) -> str:
    """Return a TOML basic string."""
    escaped = "".join(
        f"\\u{ord(c):04x}" if ord(c) < 32 or ord(c) == 127 else "\\" * (c in '"\\') + c
        for c in value
    )
    return f'"{escaped}"'


def _edit(one: Any, shift: int, detections: Detections) -> Edit:
    if not isinstance(one, dict):
        raise ParameterError("edit", "a table", repr(one))
    check_fields("edit", one, ("kind", "at", "name", "who", "when"))
    texts = {key: one.get(key, "") for key in ("kind", "name", "who", "when")}
    for key, value in texts.items():
        if not isinstance(value, str):
            raise ParameterError(key, "a text", repr(value))
    at: Any = one.get("at")
    if not isinstance(at, list) or not all(
        isinstance(each, list) and [type(x) for x in each] == [int, int] for each in at
    ):
        raise ParameterError("at", "pairs of a frame and a point", repr(at))
    for frame, point in at:
        if not 0 <= frame - shift < detections.n_frames:
            last = detections.n_frames - 1 + shift
            raise ParameterError("at", f"a frame from {shift} to {last}", frame)
        if not 0 <= point < (n := int(detections.counts[frame - shift])):
            raise ParameterError("at", f"a point below {n} in frame {frame}", point)
    return Edit(**texts, at=tuple((frame - shift, point) for frame, point in at))
