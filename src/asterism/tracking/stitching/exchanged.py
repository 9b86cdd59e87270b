"""Stretches in which two tracks have each other's marker, exchanged back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel

__all__ = ["exchanged_back"]

ROUNDS = 5
"""Largest number of times that stretches are searched. Three markers in turn take two."""


def exchanged_back(
    d: Detections, labels: NDArray[np.int64], model: TrackingModel
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Exchange tracks back where the distances to others show that they have each other's marker.

    Where two tracks are exchanged, their distances to a third one change to what those of the
    other were. The evidence of the distances in a stretch and the log-likelihood ratio of the
    motion at its edges must favour the exchange together (`engine/stitch/distance_exchanges.hpp`).

    Parameters
    ----------
    d : Detections
        The N detections.
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    model : TrackingModel
        Model of motion and noise.

    Returns
    -------
    labels : ndarray of int, shape (N,)
        Tracks after all exchanges.
    log_odds : ndarray of shape (N,)
        Log odds of the last exchange of each detection, inf without one.
    """
    labels, log_odds = labels.copy(), np.full(len(labels), np.inf)
    n_tracks = int(labels.max(initial=-1)) + 1
    kind, F, Q = steps_of(model.motion, d.times)
    motion = motion_model(model, d.n_axes)
    is_examined = np.ones(n_tracks, dtype=bool)
    for _ in range(ROUNDS):
        order = np.lexsort((d.frame_of, labels))
        order = order[labels[order] >= 0]
        offsets = np.searchsorted(labels[order], np.arange(n_tracks + 1)).astype(np.int64)
        tracks, stretches, gains = _engine.exchanged_stretches(
            motion, d.times, kind, F, Q, np.ascontiguousarray(d.points[order]),
            d.frame_of[order].astype(np.int64), offsets, is_examined,
            p_detection=min(model.sensor.p_detection, 0.999), noise=model.sensor.noise_sigma,
        )  # fmt: skip
        is_examined = np.zeros(n_tracks, dtype=bool)
        for i in np.argsort(-gains, kind="stable"):
            pair = tracks[i]
            if is_examined[pair].any():  # in the next round
                continue
            is_examined[pair] = True
            inside = slice(*d.offsets[stretches[i]])
            own = labels[inside]
            is_one, is_other = own == pair[0], own == pair[1]
            own[is_one], own[is_other] = pair[1], pair[0]
            log_odds[inside][is_one | is_other] = gains[i]
        if not is_examined.any():
            break
    return labels, log_odds
