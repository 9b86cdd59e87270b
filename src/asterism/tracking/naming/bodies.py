"""Bodies: groups of tracks that are linked by distances that hardly vary."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.rigidity.distances import distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["bodies_of"]

MAX_SPREAD = 0.06
"""Largest spread of a distance that links two tracks, metres: neighbours across a joint vary less."""
MAX_DISTANCE = 0.6
"""Largest distance of two tracks that are linked, metres."""
MIN_FRAMES = 3
"""Smallest number of common frames of two tracks that are linked."""
MIN_TRACKS = 4
"""Smallest number of tracks of a body."""


def bodies_of(positions: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Return the tracks of each body, the largest first; nothing if there is only one body.

    Parameters
    ----------
    positions : ndarray of shape (F, n, 3)
        Positions of n tracks, metres, NaN without a detection.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    found = distances_between(positions)
    linked = (found.n_frames >= MIN_FRAMES) & (found.spread < MAX_SPREAD)
    linked &= np.nan_to_num(found.middle, nan=np.inf) < MAX_DISTANCE
    n, component = connected_components(csr_matrix(linked), directed=False)
    bodies = [np.flatnonzero(component == c) for c in range(n)]
    bodies = [body for body in bodies if len(body) >= MIN_TRACKS]
    if len(bodies) == 1 and len(bodies[0]) == positions.shape[1]:
        return []
    return sorted(bodies, key=lambda body: (-len(body), int(body[0])))
