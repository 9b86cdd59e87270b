"""Search for more probable tracks of markers that accelerate together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.near_markers import with_clutter_near_markers
from asterism.tracking.attempts.probable_changes import probable_changes
from asterism.tracking.methods import MCMCDA
from asterism.tracking.rigidity import learn_shared_acceleration

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks

__all__ = ["searched_with_shared_accelerations"]

MOVES = 10.0
"""Moves for each ambiguous detection. With twice as many, hard captures are tracked no better."""


def searched_with_shared_accelerations(
    tracks: Tracks,
    model: TrackingModel,
    *,
    seed: int | None = None,
    threads: int = 1,
    progress: Callable[[int], Any] | None = None,
) -> NDArray[np.int64]:
    """Search by `MCMCDA` from tracks, with the shared accelerations learnt from them.

    Parameters
    ----------
    tracks : Tracks
        Tracks of markers, most of which are right.
    model : TrackingModel
        Model of their own motion.
    seed, threads, progress
        As for `MCMCDA`.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter, with the numbers of the given tracks.
    """
    d = tracks.detections
    model = with_clutter_near_markers(model, tracks)
    shared = learn_shared_acceleration(tracks, model)
    method = MCMCDA(window=None, moves=MOVES, end_odds=1.0, confidence=0, threads=threads)
    state = method.init(model, n_axes=d.n_axes, seed=seed, start=tracks.labels, shared=shared)
    _, found, _ = method.run(state, d, progress=progress)
    return probable_changes(tracks, found, model, shared)
