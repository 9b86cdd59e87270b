"""Search for more probable tracks of markers that accelerate together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.tracking.attempts.near_markers import with_clutter_near_markers
from asterism.tracking.methods import MCMCDA
from asterism.tracking.rigidity import learn_shared_acceleration

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks

__all__ = ["labels_of_markers", "searched_with_shared_accelerations"]

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
    return labels_of_markers(found, tracks.labels, d.frame_of)


def labels_of_markers(
    found: NDArray[np.int64], given: NDArray[np.int64], frame_of: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the labels of tracklets as those of the given tracks with which they share most.

    A tracklet without a given label becomes clutter, as does one with a frame in which a longer
    tracklet has the same label.

    Parameters
    ----------
    found, given : ndarray of int, shape (N,)
        Labels, -1 for clutter.
    frame_of : ndarray of int, shape (N,)
        Frame of each detection.
    """
    both = (found >= 0) & (given >= 0)
    n_given = int(given.max(initial=-1)) + 1
    pairs, counts = np.unique(found[both] * n_given + given[both], return_counts=True)
    label = np.full(int(found.max(initial=-1)) + 1, -1)
    order = np.argsort(counts, kind="stable")  # the most frequent one is assigned last
    label[pairs[order] // max(n_given, 1)] = pairs[order] % max(n_given, 1)
    order = np.argsort(found, kind="stable")
    order = order[found[order] >= 0]
    parts = np.split(order, np.flatnonzero(np.diff(found[order])) + 1)
    is_taken = np.zeros((n_given, int(frame_of.max(initial=-1)) + 1), dtype=bool)
    labels = np.full(len(found), -1)
    for part in sorted(parts, key=len, reverse=True):
        own = label[found[part[0]]] if len(part) else -1
        if own >= 0 and not is_taken[own, frame_of[part]].any():
            labels[part] = own
            is_taken[own, frame_of[part]] = True
    return labels
