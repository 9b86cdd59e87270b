"""Contents of a report page."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from asterism.camera import Rig
    from asterism.model import Tracks
    from asterism.model.upwards import Axis
    from asterism.reporting.places import Place
    from asterism.tracking import Naming

__all__ = ["Connections", "Contents", "Editing", "Judgement", "Score", "Verdict"]


class Verdict(IntEnum):
    """Result of the comparison of a detection's label with the truth."""

    RIGHT = 0
    """Labelled, and of the most frequent marker of its track; or clutter without a label."""
    WRONG = 1
    """Labelled, but of another marker than the most frequent one of its track, or clutter."""
    MISSED = 2
    """Detection of a marker without a label."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """Score with its explanation.

    Parameters
    ----------
    name, value : str
        Name and formatted value.
    sentence : str
        Meaning of the score in one sentence.
    """

    name: str
    value: str
    sentence: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """Comparison of tracks with the truth.

    Parameters
    ----------
    verdicts : ndarray of int, shape (N,)
        `Verdict` of each detection of the tracks.
    markers : ndarray of int, shape (N,)
        True marker of each detection, -1 for clutter.
    names : tuple of str or None
        Names of the true markers.
    scores : tuple of Score
        Scores of the tracks.
    n_elsewhere : int
        Number of detections of markers that only the truth has, which cannot be drawn.
    against : str
        ``"truth"``, or ``"other result"`` if the tracks are compared with those of a method.
    """

    verdicts: NDArray[np.int64]
    markers: NDArray[np.int64]
    names: tuple[str | None, ...]
    scores: tuple[Score, ...]
    n_elsewhere: int
    against: str = "truth"


@dataclass(frozen=True, kw_only=True, eq=False)
class Connections:
    """Lines between markers, and their segments.

    Parameters
    ----------
    pairs : ndarray of int, shape (M, 2)
        Pairs of tracks that a line connects.
    segments : ndarray of int, shape (K,)
        Rigid cluster of each track, the largest first, -1 for none.
    about : str
        Sentence about the origin of the lines, for the page.
    """

    pairs: NDArray[np.int64]
    segments: NDArray[np.int64]
    about: str


@dataclass(frozen=True, kw_only=True)
class Editing:
    """What the editor of a page needs.

    Parameters
    ----------
    file : str
        Name of the file of the edits.
    sha256 : str
        SHA-256 of the detections to which the edits refer; empty for a served page.
    shift : int
        Number of the first frame in the file of the edits, less that on the page.
    is_served : bool
        Whether a server solves the edits. Without one, the page collects them.
    version : int
        Number of changes that the tracks of the page contain.
    names : tuple of str
        Names of the marker sets, in their order.
    saved : str
        Name of the file to which the corrected tracks are saved; empty without a server.
    """

    file: str
    sha256: str
    shift: int
    is_served: bool = False
    version: int = 0
    names: tuple[str, ...] = ()
    saved: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contents:
    """Contents of a report page.

    Parameters
    ----------
    title : str
        Title, as a rule the name of the capture.
    tracks : Tracks
        Tracks in 2-D or 3-D.
    made : str
        Sentences at the top about the method and the model; may be empty.
    summary : tuple of (str, str)
        Names and values for the table about the tracking.
    warnings : tuple of str
        Warnings at the top of the page.
    up : "x", "y" or "z"
        Axis that points up.
    about_up : str
        Sentence with the reason for `up`.
    connections : Connections
        Lines between markers.
    judgement : Judgement or None
        Comparison with the truth, None without a truth.
    rig : Rig or None
        Cameras, None if they are not known.
    naming : Naming or None
        Result of the naming by which the tracks have their names, None without one.
    places : tuple of Place or None
        Places to check, the worst first; None if the identities have no probabilities.
    editing : Editing, optional
        What the editor needs; None for a page without it.
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
    naming: Naming | None = None
    places: tuple[Place, ...] | None = None
    editing: Editing | None = None
