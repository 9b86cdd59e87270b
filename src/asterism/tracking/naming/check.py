"""Names of a labelled capture that contradict marker sets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.naming.conflicts import codes_of, conflicts_of
from asterism.tracking.naming.name import name_tracks

if TYPE_CHECKING:
    from asterism.model import MarkerSet, Tracks
    from asterism.tracking.naming.conflicts import NameConflict

__all__ = ["check_names"]


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
    if naming.own is not None:
        return naming.own.conflicts
    known = sorted({name for made in marker_sets for name in made.names})
    own, found = (
        [None if name is None else name.rpartition(":")[2] for name in names]
        for names in (tracks.names, naming.tracks.names)
    )
    return conflicts_of(
        tracks,
        codes_of(tracks, own, known),
        codes_of(naming.tracks, found, known),
        np.append(naming.probabilities, 1.0)[tracks.labels],
        known,
    )
