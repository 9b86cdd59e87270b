"""Stretches in which two tracks have each other's marker, exchanged back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel
    from asterism.tracking.stitching.passes import Pass
    from asterism.tracking.stitching.whole import Stitching

__all__ = ["exchanged_back", "exchanged_by_distances", "with_markers"]

P = TypeVar("P", "Pass", "Stitching")
Accepts = Callable[["NDArray[np.int64]", "NDArray[np.int64]", "NDArray[np.int64]"], bool]

ROUNDS = 5
"""Largest number of times that stretches are searched. Three markers in turn take two."""


def exchanged_back(
    d: Detections,
    labels: NDArray[np.int64],
    model: TrackingModel,
    evidence: _engine.ExchangeEvidence = _engine.ExchangeEvidence.medians,
    accepts: Accepts | None = None,
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
    evidence : {medians, spreads, motion} of ExchangeEvidence
        Of pairs with different medians of distances. With `spreads` also of pairs with the same
        medians and different spreads, as an ankle and a toe have to the knee. With `motion` also of
        pairs with the same distances: the log-likelihood ratio of the motion at each change of
        state counts. The spreads of a track that is on several markers are large too, so that the
        last two are for tracks that are otherwise final.
    accepts : callable, optional
        Called with the labels before and after an exchange and with the exchanged detections;
        returns whether it is made. By default all are.

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
            evidence=evidence,
        )  # fmt: skip
        is_examined = np.zeros(n_tracks, dtype=bool)
        for i in np.argsort(-gains, kind="stable"):
            pair = tracks[i]
            if is_examined[pair].any():  # in the next round
                continue
            begin, end = d.offsets[stretches[i]]
            changed = begin + np.flatnonzero(np.isin(labels[begin:end], pair))
            after = labels.copy()
            after[changed] = pair.sum() - labels[changed]
            if accepts is not None and not accepts(labels, after, changed):
                continue
            labels, log_odds[changed], is_examined[pair] = after, gains[i], True
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
    log_odds[np.isinf(log_odds)] = np.nan
    return with_markers(found, labels, 1 / (1 + np.exp(-_engine.Stitcher.ODDS_FACTOR * log_odds)))


def with_markers(found: P, labels: NDArray[np.int64], probabilities: NDArray[np.float64]) -> P:
    """Change the markers of tracklets, or of parts of them.

    Parameters
    ----------
    found : Pass or Stitching
        Tracklets with their markers.
    labels : ndarray of int, shape (N,)
        Marker of each detection from now on, -1 for none. One without a tracklet that has a marker
        becomes a tracklet, and one that loses its marker leaves its tracklet.
    probabilities : ndarray of shape (N,)
        Probability that each detection changed its marker rightly, NaN for those that did not.

    Returns
    -------
    Pass or Stitching
        With each part of a tracklet that has a marker of its own as a tracklet.
    """
    # A tracklet ends where its marker changes, and where another tracklet is on its marker.
    # Tracklets are numbered by their start, as before.
    found = _with_tracklets_of(found, np.flatnonzero((found.tracklets < 0) & (labels >= 0)))
    has_marker = np.append(found.markers, -1)[found.tracklets] >= 0
    inside = np.flatnonzero((found.tracklets >= 0) & ((labels >= 0) | ~has_marker))
    of, marker = found.tracklets[inside].astype(np.int64), labels[inside]
    marker = np.where(marker >= 0, marker, labels.max() + 1 + of)  # each ghost is alone
    is_start = _changes(of, marker) | _changes(marker, of)
    order = np.argsort(marker, kind="stable")
    part, order = np.cumsum(is_start[order]) - 1, inside[order]
    first = order[np.flatnonzero(np.diff(part, prepend=-1))]
    number = np.argsort(np.argsort(first, kind="stable"), kind="stable")
    tracklets = np.full(len(found.tracklets), -1, dtype=np.int32)
    tracklets[order] = number[part]
    starts = np.sort(first)
    old = found.tracklets[starts]
    markers = np.where(labels[starts] >= 0, labels[starts], found.markers[old]).astype(np.int32)
    after = np.full(len(starts), -1, dtype=np.int32)
    chain = np.lexsort((np.arange(len(starts)), markers))
    follows = (np.diff(markers[chain]) == 0) & (markers[chain[1:]] >= 0)
    after[chain[1:][follows]] = chain[:-1][follows]
    # A join that was there before keeps its probability; the others have that of the change.
    joined = np.flatnonzero(after >= 0)
    (firsts, lasts), last = _extents(found.tracklets), _extents(tracklets)[1]
    is_new = found.after[old[joined]] != found.tracklets[last[after[joined]]]
    is_new |= starts[joined] != firsts[old[joined]]
    is_new |= last[after[joined]] != lasts[old[after[joined]]]
    new, kept = joined[is_new], found.probabilities[old].copy()
    least = np.fmin(probabilities[starts[new]], probabilities[last[after[new]]])
    # Two that did not change are joined over a part that left: by some change.
    kept[new] = np.where(np.isnan(least), np.nanmin(probabilities), least)
    return replace(found, tracklets=tracklets, markers=markers, after=after, probabilities=kept)


def _with_tracklets_of(found: P, detections: NDArray[np.int64]) -> P:
    """Make a tracklet of each of some detections that have none."""
    if not len(detections):
        return found
    tracklets, n = found.tracklets.copy(), len(found.markers)
    tracklets[detections] = n + np.arange(len(detections))
    none = np.full(len(detections), -1, dtype=np.int32)
    return replace(
        found,
        tracklets=tracklets,
        markers=np.append(found.markers, none),
        after=np.append(found.after, none),
        probabilities=np.append(found.probabilities, np.ones(len(detections))),
    )


def _changes(key: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether each element is the first of its key, or follows one of another value."""
    order = np.argsort(key, kind="stable")
    found = np.ones(len(key), dtype=bool)
    found[order[1:]] = (np.diff(key[order]) != 0) | (np.diff(other[order]) != 0)
    return found


def _extents(tracklets: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the first and the last detection of each tracklet, shape (2, F)."""
    inside = np.flatnonzero(tracklets >= 0)
    found = np.full((2, int(tracklets.max(initial=-1)) + 1), -1)
    found[0, tracklets[inside[::-1]]] = inside[::-1]
    found[1, tracklets[inside]] = inside
    return found
