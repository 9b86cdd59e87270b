"""Changes of tracks by a search, each of which is kept if it is more probable.

A search changes tracks block by block. What a change costs is complete only when the tracks are
whole again, so that the tracks with it are then compared with those without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Tracks
from asterism.tracking.attempts.absent_markers import AbsentMarkers
from asterism.tracking.attempts.posterior import gain_of_change, log_posterior

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import SharedAcceleration, TrackingModel

__all__ = ["probable_changes"]


def probable_changes(
    tracks: Tracks,
    found: NDArray[np.int64],
    model: TrackingModel,
    shared: SharedAcceleration,
) -> NDArray[np.int64]:
    """Take over the changes of a search, each if the tracks are more probable with it.

    A tracklet of the search is of the marker whose label is the first that its detections were
    given. A change by which tracks only lose detections is not taken over: jolts are less probable
    by the model than they are. A tracklet without a given label is of the marker with bonds, absent
    in its frames, with which the tracks are most probable, among those whose distances it keeps. It
    is clutter if they are more probable with it as clutter, or as a track of no marker.

    Parameters
    ----------
    tracks : Tracks
        Tracks from which the search started, one for each marker.
    found : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for clutter.
    model : TrackingModel
        Model of the markers' own motion.
    shared : SharedAcceleration
        Shared accelerations, learnt from the given tracks.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter, with the numbers of the given tracks.
    """
    given, frame_of = tracks.labels, tracks.detections.frame_of
    labels = _labels_of_markers(found, given, frame_of)
    for change in _changes(given, labels, frame_of, model.population.max_gap):
        before = labels.copy()
        before[change] = given[change]
        is_loss = (labels[change] < 0).all()
        if is_loss or gain_of_change(change, before, labels, tracks, model, shared) <= 0:
            labels = before
    markers = AbsentMarkers(tracks, labels, model, shared)
    for tracklet in _groups(found):
        if (labels[tracklet] >= 0).any() or (given[tracklet] >= 0).any():
            continue
        log_odds, marker = markers.best(tracklet)
        if log_odds > max(_of_no_marker(tracklet, tracks, model), 0.0):
            markers.move(tracklet, marker)
    return markers.labels


def _of_no_marker(tracklet: NDArray[np.int64], tracks: Tracks, model: TrackingModel) -> float:
    """Return the log posterior of a tracklet as a track by itself, against clutter."""
    d = tracks.detections
    first, end = int(d.frame_of[tracklet[0]]), int(d.frame_of[tracklet[-1]]) + 1
    labels = np.full(d.offsets[end] - d.offsets[first], -1)
    labels[tracklet - d.offsets[first]] = 0
    return log_posterior(Tracks(detections=d.part(first, end), labels=labels), model)


def _labels_of_markers(
    found: NDArray[np.int64], given: NDArray[np.int64], frame_of: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the labels of tracklets, each the first that its detections were given.

    A tracklet without a given label becomes clutter, as does one with a frame in which a longer
    tracklet has the same label.
    """
    labels = np.full(len(found), -1)
    is_taken = np.zeros((int(given.max(initial=-1)) + 1, int(frame_of.max(initial=-1)) + 1), bool)
    for tracklet in sorted(_groups(found), key=len, reverse=True):
        known = given[tracklet][given[tracklet] >= 0]
        if len(known) and not is_taken[known[0], frame_of[tracklet]].any():
            labels[tracklet] = known[0]
            is_taken[known[0], frame_of[tracklet]] = True
    return labels


def _changes(
    given: NDArray[np.int64], labels: NDArray[np.int64], frame_of: NDArray[np.int64], max_gap: int
) -> list[NDArray[np.int64]]:
    """Return the detections of each change, in time order.

    Two detections whose label has changed are of one change if a marker has or had both, at most
    `max_gap` frames apart, with no detection between them that it keeps.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n, is_changed = len(given), given != labels
    detections = np.flatnonzero(is_changed)
    kept = np.flatnonzero(~is_changed & (labels >= 0))
    all_of = np.concatenate([detections, detections, kept])
    marker = np.concatenate([given[detections], labels[detections], labels[kept]])
    order = np.lexsort([all_of, marker])
    order = order[marker[order] >= 0]
    all_of, marker = all_of[order], marker[order]
    is_one = is_changed[all_of[1:]] & is_changed[all_of[:-1]] & (marker[1:] == marker[:-1])
    is_one &= np.diff(frame_of[all_of]) <= max_gap
    links = (np.ones(int(is_one.sum())), (all_of[:-1][is_one], all_of[1:][is_one]))
    _, groups = connected_components(coo_matrix(links, shape=(n, n)), directed=False)
    changes = _groups(np.where(is_changed, groups, -1))
    return sorted(changes, key=lambda change: int(frame_of[change[0]]))


def _groups(numbers: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the detections of each number, without those of -1."""
    order = np.argsort(numbers, kind="stable")
    order = order[numbers[order] >= 0]
    if not len(order):
        return []
    return np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
