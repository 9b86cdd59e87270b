"""Names of a labelled capture that contradict marker sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record
from asterism.tracking.naming.name import name_tracks

if TYPE_CHECKING:
    from asterism.model import MarkerSet, Tracks

__all__ = ["NameConflict", "check_names"]

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


def check_names(tracks: Tracks, *marker_sets: MarkerSet) -> tuple[NameConflict, ...]:
    """Return the stretches in which the names of a labelled capture contradict marker sets.

    Parameters
    ----------
    tracks : Tracks
        Tracks with names; those without one, or with a name that no set has, are not checked.
    *marker_sets : MarkerSet
        Sets learnt from other captures.

    Returns
    -------
    tuple of NameConflict
        By track, then by time.

    Raises
    ------
    ParameterError
        As for `name_tracks`.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=60, seed=1)
    >>> made = am.learn_marker_set(truth)
    >>> am.tracking.check_names(truth, made)
    ()
    """
    tracks = tracks.measured()
    naming = name_tracks(tracks, *marker_sets)
    own = [None if name is None else name.rpartition(":")[2] for name in tracks.names]
    known = {name for made in marker_sets for name in made.names}
    found = [None if name is None else name.rpartition(":")[2] for name in naming.tracks.names]
    code = {name: n for n, name in enumerate(sorted(known))}
    given = np.array([code.get(name or "", -1) for name in [*own, None]])[tracks.labels]
    by_sets = np.array([code.get(name or "", -1) for name in [*found, None]])[naming.tracks.labels]
    order, _ = tracks.by_track
    track, is_conflict = tracks.labels[order], (given != by_sets)[order] & (given[order] >= 0)
    frame = tracks.detections.frame_of[order]
    other = by_sets[order]
    starts = np.flatnonzero(
        np.diff(track, prepend=-1)
        | np.diff(is_conflict, prepend=False)
        | np.diff(other, prepend=-2)
    )
    ends = np.append(starts, len(order))[1:] - 1
    names = sorted(known)
    return tuple(
        NameConflict(
            name=str(tracks.names[track[a]]),
            first=int(frame[a]),
            last=int(frame[b]),
            found=names[int(other[a])] if other[a] >= 0 else None,
            probability=float(naming.probabilities[track[a]]),
        )
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
        if is_conflict[a] and frame[b] - frame[a] + 1 >= MIN_FRAMES
    )
