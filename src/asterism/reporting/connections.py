"""Lines between bonded markers and their segments, which make a body visible."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.reporting.page import Connections
from asterism.reporting.page.thinning import thinned
from asterism.tracking.rigidity import learn_bonds

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["connections_of"]

MOST_MARKERS = 200
"""Number of longest tracks among which bonds are estimated; the time grows with its square."""
MOST_FRAMES = 500
EACH = 2
"""Number of shortest bonds of each marker that are drawn in addition to the spanning forest."""
FARTHEST = 8.0
"""Longest bond that is drawn, in median distances from a marker to its nearest bonded one."""
_NO_PAIRS = np.empty((0, 2), dtype=np.int64)


def connections_of(tracks: Tracks) -> Connections:
    """Estimate the bonds between markers, and select the lines and the segments to draw.

    A body has more bonds than a reader can distinguish. The lines are a minimal spanning forest of
    the bonds, and the `EACH` shortest bonds of each marker.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the page; filled points are not used.

    Returns
    -------
    Connections
        Lines, segments, and a sentence about the lines for the page.
    """
    tracks = tracks.measured()
    longest = np.argsort(-tracks.lengths, kind="stable")[:MOST_MARKERS]
    longest = np.sort(longest[tracks.lengths[longest] > 0])
    T = tracks.detections.n_frames
    few, _ = thinned(tracks, np.arange(0, T, max(1, -(-T // MOST_FRAMES))))
    number = np.full(tracks.n_tracks + 1, -1)
    number[longest] = np.arange(len(longest))
    # Without names, because two tracks of one name are allowed in a picture.
    bonds = learn_bonds(replace(few, labels=number[few.labels], names=(None,) * len(longest)))
    segments = np.full(tracks.n_tracks, -1)
    for n, cluster in enumerate(bonds.clusters):
        segments[longest[list(cluster)]] = n
    order = np.argsort(bonds.distances, kind="stable")
    steady = order[bonds.steady[order]]
    nearest = np.full(len(longest), np.inf)
    for side in bonds.pairs[steady].T:
        np.minimum.at(nearest, side, bonds.distances[steady])
    usual = np.median(nearest[np.isfinite(nearest)]) if len(steady) else 0.0
    steady = steady[bonds.distances[steady] <= FARTHEST * usual]
    n_drawn = np.zeros(len(longest), dtype=np.int64)
    body = np.arange(len(longest))  # connected component of each marker
    chosen: list[tuple[int, int]] = []
    for i, j in bonds.pairs[steady]:
        if body[i] != body[j] or n_drawn[i] < EACH or n_drawn[j] < EACH:
            body[body == body[j]] = body[i]
            chosen.append((int(longest[i]), int(longest[j])))
            n_drawn[[i, j]] += 1
    if not chosen:
        text = "No lines are drawn: no bonds were found between markers."
        return Connections(pairs=_NO_PAIRS, segments=segments, about=text)
    text = (
        f"Lines are bonds: pairs of markers with a stable distance in this capture. The shortest "
        f"{len(chosen)} of {len(steady)} that connect each body are drawn."
    )
    if np.count_nonzero(tracks.lengths) > MOST_MARKERS:
        text += f" Only the {MOST_MARKERS} longest tracks were searched for bonds."
    pairs = np.array(sorted(chosen), dtype=np.int64)
    return Connections(pairs=pairs, segments=segments, about=text)
