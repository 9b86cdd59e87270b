"""Stretches in which two tracks have each other's marker, exchanged back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel
    from asterism.tracking.stitching.passes import Pass

__all__ = ["exchanged_back", "exchanged_by_distances"]

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


def exchanged_by_distances(d: Detections, found: Pass, model: TrackingModel) -> Pass:
    """Exchange the markers of tracklets, or of parts of them, that have each other's marker.

    Parameters
    ----------
    d : Detections
        Detections of the capture.
    found : Pass
        Tracklets with their markers.
    model : TrackingModel
        Model of motion and noise.

    Returns
    -------
    Pass
        With each part of a tracklet that has a marker of its own as a tracklet.
    """
    before = np.append(np.maximum(found.markers, -1), -1).astype(np.int64)[found.tracklets]
    labels, log_odds = exchanged_back(d, before, model)
    if np.array_equal(labels, before):
        return found
    # Each part of a tracklet with a marker of its own is a tracklet; they are numbered by their
    # start, as before.
    inside = np.flatnonzero(found.tracklets >= 0)
    order = inside[np.argsort(found.tracklets[inside], kind="stable")]
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = np.diff(found.tracklets[order]) != 0
    is_edge = np.zeros(len(order), dtype=bool)
    is_edge[1:] = ~begins[1:] & (np.diff(labels[order]) != 0)
    part = np.cumsum(begins | is_edge) - 1
    first = order[begins | is_edge]
    number = np.argsort(np.argsort(first, kind="stable"), kind="stable")
    tracklets = np.full(len(found.tracklets), -1, dtype=np.int32)
    tracklets[order] = number[part]
    starts = np.sort(first)
    old = found.tracklets[starts]
    markers = np.where(found.markers[old] < 0, found.markers[old], labels[starts]).astype(np.int32)
    after = np.full(len(starts), -1, dtype=np.int32)
    chain = np.lexsort((np.arange(len(starts)), markers))
    follows = (np.diff(markers[chain]) == 0) & (markers[chain[1:]] >= 0)
    after[chain[1:][follows]] = chain[:-1][follows]
    # A join that was there before keeps its probability; the others have that of the exchange.
    probabilities = found.probabilities[old].copy()
    last = np.full(len(starts), -1)
    last[tracklets[order]] = order
    joined = np.flatnonzero(after >= 0)
    same = (found.after[old[joined]] == found.tracklets[last[after[joined]]]) & (
        starts[joined] == _first_of(found.tracklets)[old[joined]]
    )
    new = joined[~same]
    odds = np.minimum(log_odds[starts[new]], log_odds[last[after[new]]])
    odds[np.isinf(odds)] = log_odds.min()  # joined over a part that left: by some exchange
    probabilities[new] = 1 / (1 + np.exp(-_engine.Stitcher.ODDS_FACTOR * odds))
    return replace(
        found, tracklets=tracklets, markers=markers, after=after, probabilities=probabilities
    )


def _first_of(tracklets: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the first detection of each tracklet."""
    inside = np.flatnonzero(tracklets >= 0)[::-1]
    first = np.full(int(tracklets.max(initial=-1)) + 1, -1)
    first[tracklets[inside]] = inside
    return first
