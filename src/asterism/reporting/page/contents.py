"""Contents of a report page, as the caller hands them over."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from asterism.camera import Rig
    from asterism.model import Tracks

__all__ = ["Axis", "Connections", "Contents", "Judgement", "Score", "Verdict"]

Axis = Literal["x", "y", "z"]
"""The axis that points up."""


class Verdict(IntEnum):
    """What the truth says about the label of a detection."""

    RIGHT = 0
    """Labelled with the marker that its track has most often, or rightly clutter."""
    WRONG = 1
    """Labelled, but of another marker than its track, or of none."""
    MISSED = 2
    """A marker that was taken for clutter."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """A number and what it says.

    Parameters
    ----------
    name, value : str
        As people read them.
    sentence : str
        What the number means, in one plain sentence.
    """

    name: str
    value: str
    sentence: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """What is known from the truth.

    Parameters
    ----------
    verdicts : ndarray of int, shape (N,)
        A `Verdict` for each detection of the tracks.
    markers : ndarray of int, shape (N,)
        The true marker of each detection, -1 for clutter.
    names : tuple of str or None
        Of the true markers.
    scores : tuple of Score
        How good the tracks are.
    n_elsewhere : int
        Detections of markers that the truth has and the tracks lack: they cannot be drawn.
    """

    verdicts: NDArray[np.int64]
    markers: NDArray[np.int64]
    names: tuple[str | None, ...]
    scores: tuple[Score, ...]
    n_elsewhere: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Connections:
    """Lines between markers.

    Parameters
    ----------
    pairs : ndarray of int, shape (M, 2)
        Tracks that are joined by a line.
    about : str
        Where they come from, a sentence for people.
    """

    pairs: NDArray[np.int64]
    about: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """All that a report shows.

    Parameters
    ----------
    title : str
        Usually the name of the capture.
    tracks : Tracks
        2-D or 3-D.
    made : str
        How the tracks were made, a sentence or two for the top; may be empty.
    summary : tuple of (str, str)
        What was done, as names and values.
    warnings : tuple of str
        What the reader should know before believing anything.
    up : "x", "y" or "z"
        The axis that points up.
    about_up : str
        How that is known, a sentence.
    connections : Connections
        Lines between markers.
    judgement : Judgement or None
        What the truth says, where there is one.
    rig : Rig or None
        The cameras, where they are known.
    """

    title: str
    tracks: Tracks
    made: str
    summary: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    up: Axis
    about_up: str
    connections: Connections
    judgement: Judgement | None = None
    rig: Rig | None = None
