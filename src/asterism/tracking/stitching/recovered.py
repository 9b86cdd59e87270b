"""Markers all of whose tracklets stitching took for ghosts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.stitching.passes import GHOST

if TYPE_CHECKING:
    from asterism.model import Tracks
    from asterism.tracking.stitching.passes import Pass

__all__ = ["recovered_from_ghosts"]

MAX_GHOSTS = 60
"""Largest number of detections of ghosts in one track. It was 39 on captures with simulated ghosts
of up to 10 frames each."""
MOST = 0.9
"""Smallest share of ghosts in a track of a marker. The ghosts of tracks that change between markers
in fast motion were at most 56 %."""
RECOVERED = 0.95
"""Probability of the joins of a marker. On simulated people 10 of 10 were right."""


def recovered_from_ghosts(found: Pass, tracks: Tracks) -> Pass:
    """Make a marker of the ghosts of a long track that has hardly any other detections.

    A marker that its neighbours contradict again and again is cut into tracklets that are ghosts
    only because they are short.

    Parameters
    ----------
    found : Pass
        Result of the last pass.
    tracks : Tracks
        Tracks that are stitched.

    Returns
    -------
    Pass
        The same tracklets, of more markers and fewer ghosts.
    """
    inside = np.flatnonzero(found.tracklets >= 0)
    track, own = tracks.labels[inside], found.tracklets[inside]
    is_ghost = found.markers[own] == GHOST
    n_all = np.bincount(track)
    n_ghosts = np.bincount(track[is_ghost], minlength=len(n_all))
    markers, after, probabilities = (
        each.copy() for each in (found.markers, found.after, found.probabilities)
    )
    for each in np.flatnonzero((n_ghosts > MAX_GHOSTS) & (n_ghosts >= MOST * n_all)):
        parts = np.unique(own[is_ghost & (track == each)])  # numbered by their start
        markers[parts] = markers.max(initial=-1) + 1
        after[parts[1:]] = parts[:-1]
        probabilities[parts] = RECOVERED
    return replace(found, markers=markers, after=after, probabilities=probabilities)
