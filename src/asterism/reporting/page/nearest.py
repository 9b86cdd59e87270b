"""Distance between neighbouring markers, the scale of other distances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["usual_distance"]

FRAMES = 100
"""Number of evenly spaced frames that are measured."""
ALONE = 0.05
"""Distance in metres that is used if there is only one marker."""


def usual_distance(tracks: Tracks) -> float:
    """Return the median distance of a labelled point to its nearest neighbour, metres."""
    from scipy.spatial import KDTree

    d = tracks.detections
    found: list[NDArray[np.float64]] = []
    for t in range(0, d.n_frames, max(1, d.n_frames // FRAMES)):
        points = d.frame(t)[tracks.labels[d.offsets[t] : d.offsets[t + 1]] >= 0]
        if len(points) > 1:
            tree: Any = KDTree(points)
            found.append(tree.query(points, 2)[0][:, 1])
    return float(np.median(np.concatenate(found))) if found else ALONE
