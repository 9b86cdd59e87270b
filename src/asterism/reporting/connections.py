"""Lines between markers that keep their distance, so that a body can be seen in the points."""

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
"""Tracks among which bonds are learnt, the longest; the time goes with the square."""
MOST_FRAMES = 500
EACH = 2
"""Bonds of a marker that are drawn beside those that hold the body together."""
FARTHEST = 8.0
"""Longest bond that is drawn, in usual distances from a marker to its nearest bonded one."""
_NO_PAIRS = np.empty((0, 2), dtype=np.int64)


def connections_of(tracks: Tracks) -> Connections:
    """Learn which markers keep their distances, and choose the lines to draw.

    A body has far more bonds than an eye can sort out. Of the steady ones those are drawn that
    join all that can be joined over the shortest ways (a minimal spanning forest), and the `EACH`
    shortest of each marker.

    Parameters
    ----------
    tracks : Tracks

    Returns
    -------
    Connections
    """
    tracks = tracks.measured()
    longest = np.argsort(-tracks.lengths, kind="stable")[:MOST_MARKERS]
    longest = np.sort(longest[tracks.lengths[longest] > 0])
    few = thinned(tracks, max(1, -(-tracks.detections.n_frames // MOST_FRAMES)))
    number = np.full(tracks.n_tracks + 1, -1)
    number[longest] = np.arange(len(longest))
    # Without names: two tracks of one name are no hindrance to a picture.
    bonds = learn_bonds(
        replace(few, labels=number[few.labels], names=(None,) * len(longest), confidence=None)
    )
    order = np.argsort(bonds.distances, kind="stable")
    steady = order[bonds.steady[order]]
    nearest = np.full(len(longest), np.inf)
    for side in bonds.pairs[steady].T:
        np.minimum.at(nearest, side, bonds.distances[steady])
    usual = np.median(nearest[np.isfinite(nearest)]) if len(steady) else 0.0
    steady = steady[bonds.distances[steady] <= FARTHEST * usual]
    n_drawn = np.zeros(len(longest), dtype=np.int64)
    body = np.arange(len(longest))  # which markers are joined already
    chosen: list[tuple[int, int]] = []
    for i, j in bonds.pairs[steady]:
        if body[i] != body[j] or n_drawn[i] < EACH or n_drawn[j] < EACH:
            body[body == body[j]] = body[i]
            chosen.append((int(longest[i]), int(longest[j])))
            n_drawn[[i, j]] += 1
    if not chosen:
        text = "No lines between markers: no two were found to keep their distance."
        return Connections(pairs=_NO_PAIRS, about=text)
    text = (
        f"Lines join markers that were found to keep their distance in this take (bonds learnt "
        f"from it): {len(chosen)} of {len(steady)}, the shortest ones that hold a body together."
    )
    if np.count_nonzero(tracks.lengths) > MOST_MARKERS:
        text += f" They were looked for among the {MOST_MARKERS} longest tracks alone."
    return Connections(pairs=np.array(sorted(chosen), dtype=np.int64), about=text)
