"""Edit: what a person states about detections, as a constraint on the tracking."""

from __future__ import annotations

from typing import Literal, get_args

from asterism.checks import check_number
from asterism.errors import ParameterError, clipped
from asterism.records import record

__all__ = ["Edit", "EditKind"]

EditKind = Literal[
    "same", "only", "different", "cut", "clutter", "name", "fill", "no_fill", "reassign",
    "reassign_even",
]  # fmt: skip
REASSIGN: tuple[EditKind, ...] = ("reassign", "reassign_even")
"""Kinds that assign all uncertain detections once more."""

N_DETECTIONS = {"clutter": (1,), "name": (1,), "only": (2, 3), **dict.fromkeys(REASSIGN)}
"""Numbers of detections of an edit, where it is not two; None for any number."""


@record
class Edit:
    """Statement of a person about detections, which the tracks must respect.

    Parameters
    ----------
    kind : {"same", "only", "different", "cut", "clutter", "name", "fill", "no_fill", "reassign",
        "reassign_even"}
        ``same``: both detections are of one marker. ``only``: they are, and the second alone goes
        to the track of the first, in exchange for that in its frame; with a third detection, those
        of the second's track up to the third do. ``different``: they are not. ``cut``: they
        follow each other in a track and are not of one marker, and the track is parted exactly
        there. ``clutter``: the detection is a false alarm. ``name``: it is of the marker `name`.
        ``fill``, ``no_fill``: the gap between both detections is filled, or is left open.
        ``reassign``: all uncertain detections are assigned once more, given the tracks as the
        earlier edits have corrected them; those of the edit stay, now and in later ones.
        ``reassign_even``: the same at even odds, for a person who looks at every change.
    at : tuple of (int, int)
        Frame of each detection, counted from 0, and its number among the points of that frame.
    name : str
        Name of the marker, for ``name``.
    who : str
        Person who made the edit.
    when : str
        Time of the edit, ISO 8601.

    Raises
    ------
    ParameterError
        If the kind is unknown, or the detections or the name do not belong to it.

    Examples
    --------
    >>> Edit(kind="same", at=((10, 3), (48, 0)))
    Edit(same: frame 10 point 3, frame 48 point 0)
    >>> Edit(kind="name", at=((10, 3),))
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: name: expected the name of a marker, found nothing
    """

    kind: EditKind
    at: tuple[tuple[int, int], ...]
    name: str = ""
    who: str = ""
    when: str = ""

    def __post_init__(self) -> None:
        if self.kind not in get_args(EditKind):
            raise ParameterError("kind", " or ".join(get_args(EditKind)), repr(self.kind))
        n = N_DETECTIONS.get(self.kind, (2,))
        at = tuple((frame, point) for frame, point in self.at)
        if n is not None and len(at) not in n:
            expected = f"{' or '.join(map(str, n))} detection{'s' * (n != (1,))} for {self.kind!r}"
            raise ParameterError("at", expected, f"{len(at)}")
        for number in (number for each in at for number in each):
            check_number("at", number, above=0, closed=True, integer=True)
        if n == (2,) and at[0][0] == at[1][0] and self.kind != "different":
            raise ParameterError("at", "detections of two frames", f"two of frame {at[0][0]}")
        if (self.kind == "name") != bool(self.name):
            expected = "the name of a marker" if self.kind == "name" else f"none for {self.kind!r}"
            raise ParameterError("name", expected, self.name or "nothing")
        object.__setattr__(self, "at", at)

    def __repr__(self) -> str:
        places = ", ".join(f"frame {frame} point {point}" for frame, point in self.at)
        name = f" {clipped(self.name, 80)}" if self.name else ""
        return f"Edit({self.kind}{name}{': ' * bool(places)}{places})"
