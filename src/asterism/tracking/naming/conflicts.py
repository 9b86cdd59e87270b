"""Names that a capture had before, against those that its detections have been given."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record
from asterism.tracking.naming.stretches import stretches_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["KeptNames", "NameConflict", "codes_of", "conflicts_of", "kept_names"]

MIN_FRAMES = 3
"""Shortest stretch that is listed, frames."""


@record
class NameConflict:
    """Stretch of frames in which a track's own name contradicts the marker sets.

    Parameters
    ----------
    name : str
        Name of the track in the capture.
    first, last : int
        First and last frame.
    found : str or None
        Name by the marker sets, None for none.
    probability : float
        Probability of the name that was found, for the track as a whole.

    Examples
    --------
    >>> conflict = NameConflict(name="RNAV", first=0, last=167, found="RHLX", probability=0.98)
    >>> conflict.found
    'RHLX'
    """

    name: str
    first: int
    last: int
    found: str | None
    probability: float


@record
class KeptNames:
    """Result for the names that a capture had itself.

    Parameters
    ----------
    kept : tuple of str
        Names that most of their detections keep.
    moved : tuple of str
        Names that most of their detections lose, and others have.
    left_out : tuple of str
        Names that no track has any more.
    conflicts : tuple of NameConflict
        Stretches in which the names of the capture are contradicted, by track and then by time.

    Examples
    --------
    >>> import asterism as am
    >>> kept = am.name_tracks(am.simulate.fingers(frames=60, seed=1)).own
    >>> len(kept.kept), kept.moved, kept.left_out, kept.conflicts
    (23, (), (), ())
    """

    kept: tuple[str, ...]
    moved: tuple[str, ...]
    left_out: tuple[str, ...]
    conflicts: tuple[NameConflict, ...]


def codes_of(
    tracks: Tracks, names: Sequence[str | None], known: Sequence[str]
) -> NDArray[np.int64]:
    """Return the number in `known` of each detection's name, (N,), -1 for none or another.

    Parameters
    ----------
    tracks : Tracks
        Tracks of N detections.
    names : sequence of (str or None)
        Name of each track.
    known : sequence of str
        Names, each once.
    """
    code = {name: n for n, name in enumerate(known)}
    return np.array([code.get(name or "", -1) for name in [*names, None]])[tracks.labels]


def conflicts_of(
    tracks: Tracks,
    given: NDArray[np.int64],
    found: NDArray[np.int64],
    probabilities: NDArray[np.float64],
    names: Sequence[str],
) -> tuple[NameConflict, ...]:
    """Return the stretches in which detections have other names than the tracks had.

    Parameters
    ----------
    tracks : Tracks
        Tracks as the capture had them.
    given, found : ndarray of int, shape (N,)
        Name of each detection before and after, by its number in `names`, -1 for none.
    probabilities : ndarray of shape (N,)
        Probability of the name that was found.
    names : sequence of str
        Names.
    """
    is_conflict = (given >= 0) & (given != found)
    return tuple(
        NameConflict(
            name=str(tracks.names[own.track]),
            first=own.first,
            last=own.last,
            found=names[own.value] if own.value >= 0 else None,
            probability=float(np.median(probabilities[own.rows])),
        )
        for own in stretches_of(tracks, np.where(is_conflict, found, -2))
        if own.value > -2 and own.last - own.first + 1 >= MIN_FRAMES
    )


def kept_names(
    tracks: Tracks,
    given: NDArray[np.int64],
    found: NDArray[np.int64],
    probabilities: NDArray[np.float64],
    names: Sequence[str],
) -> KeptNames:
    """Return which names are kept, and where they are contradicted.

    Parameters
    ----------
    tracks, given, found, probabilities, names
        As for `conflicts_of`.
    """
    n = len(names)
    before = np.bincount(given[given >= 0], minlength=n)
    same = np.bincount(given[(given >= 0) & (given == found)], minlength=n)
    after = np.bincount(found[found >= 0], minlength=n)
    is_kept = 2 * same > before

    def chosen(which: NDArray[np.bool_]) -> tuple[str, ...]:
        return tuple(names[m] for m in np.flatnonzero(which).tolist())

    return KeptNames(
        kept=chosen(is_kept),
        moved=chosen(~is_kept & (after > 0)),
        left_out=chosen(~is_kept & (after == 0)),
        conflicts=conflicts_of(tracks, given, found, probabilities, names),
    )
