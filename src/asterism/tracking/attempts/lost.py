"""Detections of markers that their tracks have lost, found by the distances to others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.tracking.rigidity.distances import distances_between
from asterism.tracking.rigidity.sampled import sampled_positions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["with_lost_markers"]

STEADY = 0.05
"""Largest standard deviation of a distance that is compared, metres."""


def with_lost_markers(
    detections: Detections, labels: NDArray[np.int64], noise_sigma: float
) -> NDArray[np.int64]:
    """Give detections without a track to tracks that have none in the frame, by their distances.

    A body that moves by more than the motion model admits is lost as a whole for some frames. Its
    markers are found one after the other, the clearest first, and each of them helps to find the
    next. Motion is not used, so that a marker is found far from where it was lost.

    Parameters
    ----------
    detections : Detections
        Detections of a capture.
    labels : ndarray of int, shape (N,)
        Track of each, -1 for clutter.
    noise_sigma : float
        Standard deviation of a coordinate, metres.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.

    Notes
    -----
    A detection is compared with up to five steadiest distances of a track that are bonds. Its log
    odds are those of these distances against any distance, and must be 6, and 3 more than those of
    all other detections of the track, and of all other tracks.
    """
    d = detections
    n_tracks = int(labels.max(initial=-1)) + 1
    distances = distances_between(sampled_positions(d, labels, n_tracks))
    spread = np.sqrt(distances.predictive_variance + 2 * noise_sigma**2)
    spread[~distances.is_bond | (spread > STEADY)] = np.inf
    return _engine.find_lost(
        np.ascontiguousarray(d.points), labels, d.offsets.astype(np.int64),
        np.nan_to_num(distances.middle), spread,
    )  # fmt: skip
