"""Markers that stitching took for many ghosts in a row."""

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
"""Largest number of detections of ghosts in a row. The longest row had 39, on captures with
simulated ghosts of up to 10 frames each."""
RECOVERED = 0.95
"""Probability of the joins in a row that is a marker. On simulated people 10 of 10 were right."""


def recovered_from_ghosts(found: Pass, tracks: Tracks, max_gap: int) -> Pass:
    """Take each long row of ghosts for a marker.

    A marker that its neighbours contradict again and again is cut into tracklets that are ghosts
    only because they are short. They are a row: they follow each other in one of the tracks that
    are stitched.

    Parameters
    ----------
    found : Pass
        Result of the last pass.
    tracks : Tracks
        Tracks that are stitched.
    max_gap : int
        Longest gap in a row, frames.

    Returns
    -------
    Pass
        The same tracklets, of more markers and fewer ghosts.
    """
    order, _ = tracks.by_track
    order = order[found.tracklets[order] >= 0]
    own = found.tracklets[order]
    is_ghost = found.markers[own] == GHOST
    starts = np.ones(len(order), dtype=bool)
    starts[1:] = (
        (np.diff(tracks.labels[order]) != 0)
        | (np.diff(is_ghost) != 0)
        | (np.diff(tracks.detections.frame_of[order]) > max_gap + 1)
    )
    row = np.cumsum(starts)
    markers, after, probabilities = (
        each.copy() for each in (found.markers, found.after, found.probabilities)
    )
    for each in np.flatnonzero(np.bincount(row[is_ghost]) > MAX_GHOSTS):
        parts = np.unique(own[row == each])  # numbered by their start
        markers[parts] = markers.max(initial=-1) + 1
        after[parts[1:]] = parts[:-1]
        probabilities[parts] = RECOVERED
    return replace(found, markers=markers, after=after, probabilities=probabilities)
