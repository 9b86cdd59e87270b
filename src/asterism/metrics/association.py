"""Percentages of the 2010 report, and the links on which they are based."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics.counts import check_frames, check_labels, overlap, ratio, successions
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["AssociationScores", "association_scores", "right_identities", "right_links"]


@record(eq=False)
class AssociationScores:
    """Result of `association_scores`. A percentage of an empty set is NaN.

    Attributes
    ----------
    wrong_percent : float
        Share of labelled detections whose marker differs from their track's most frequent marker
        (the lowest if several are equally frequent). Labelled clutter is wrong.
    wrong_first_percent : float
        The same share, if the marker of a track is that of its first detection. All detections
        after a switch are then wrong, and all of a track that starts with clutter.
    missing_percent : float
        Share of detections of markers that have no label.
    clutter_labelled_percent : float
        Share of clutter (false alarms, ghosts) that has a label.
    n_markers, n_tracks : int
        Number of markers with a detection, and number of tracks.
    tracks_per_marker : float
        Number of tracks per marker; 1 is best.
    wrong_links : int
        Number of pairs of consecutive detections in a track that are not of one marker.
    broken_links : int
        Number of pairs of consecutive detections of a marker that are not consecutive in one
        track.
    frames_by_wrong : tuple of int
        Number of frames with 0, 1, 2 … wrong associations, by the track's most frequent marker.
    frame_wrong, frame_wrong_first : ndarray of int, shape (T,)
        Number of wrong associations in each frame, as in `wrong_percent` and in
        `wrong_first_percent`.

    Examples
    --------
    >>> association_scores([0, 0, 1], [0, 0, 0], [0, 1, 2]).tracks_per_marker
    2.0
    """

    wrong_percent: float
    wrong_first_percent: float
    missing_percent: float
    clutter_labelled_percent: float
    n_markers: int
    n_tracks: int
    tracks_per_marker: float
    wrong_links: int
    broken_links: int
    frames_by_wrong: tuple[int, ...]
    frame_wrong: NDArray[np.int64]
    frame_wrong_first: NDArray[np.int64]


def association_scores(
    labels: ArrayLike,
    truth_labels: ArrayLike,
    frame_of: ArrayLike,
    *,
    n_frames: int | None = None,
) -> AssociationScores:
    """Compute the 2010 report's scores: wrong associations, number of tracks, missing labels.

    The report also counts as wrong all detections in further tracks of a marker, even if these
    tracks are pure; that share is ``100 · (1 − idp)`` of `asterism.metrics.identity_scores`.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    frame_of : array_like of int, shape (N,)
        Frame of each detection, in increasing order.
    n_frames : int, optional
        Number of frames. By default the last frame is that of the last detection.

    Returns
    -------
    AssociationScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    Examples
    --------
    >>> association_scores([0, 0, 0], [0, 0, 1], [0, 1, 2]).wrong_links
    1
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    frame_of, n_frames = check_frames(frame_of, len(labels), n_frames)
    is_true, is_labelled = truth_labels >= 0, labels >= 0
    pairs = overlap(labels, truth_labels)
    members, is_right = right_identities(labels, truth_labels)
    first = np.full(len(pairs.track_sizes), -1)
    first[labels[members[::-1]]] = truth_labels[members[::-1]]
    is_as_first = (first[labels[members]] == truth_labels[members]) & is_true[members]
    wrong, wrong_first = (
        np.bincount(frame_of[members[~right]], minlength=n_frames)
        for right in (is_right, is_as_first)
    )

    _, is_right = right_links(labels, truth_labels)
    before_in_truth, before_in_track = np.full((2, len(labels)), -1)
    for before_of, whose in ((before_in_truth, truth_labels), (before_in_track, labels)):
        before, after = successions(whose)
        before_of[after] = before
    is_broken = (before_in_truth >= 0) & (before_in_truth != before_in_track)
    n_markers, n_used = (int(np.count_nonzero(s)) for s in (pairs.marker_sizes, pairs.track_sizes))
    return AssociationScores(
        wrong_percent=100 * ratio(wrong.sum(), len(members)),
        wrong_first_percent=100 * ratio(wrong_first.sum(), len(members)),
        missing_percent=100 * ratio(np.count_nonzero(is_true & ~is_labelled), is_true.sum()),
        clutter_labelled_percent=100
        * ratio(np.count_nonzero(is_labelled & ~is_true), np.count_nonzero(~is_true)),
        n_markers=n_markers,
        n_tracks=n_used,
        tracks_per_marker=ratio(n_used, n_markers),
        wrong_links=int(np.count_nonzero(~is_right)),
        broken_links=int(np.count_nonzero(is_broken)),
        frames_by_wrong=tuple(np.bincount(wrong).tolist()),
        frame_wrong=wrong,
        frame_wrong_first=wrong_first,
    )


def right_links(
    labels: ArrayLike, truth_labels: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Find the detections that continue a track, and whether each continues its marker.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection in the order of their frames, -1 for none.

    Returns
    -------
    successors : ndarray of int, shape (L,)
        Indices of the detections with a predecessor in their track.
    is_right : ndarray of bool, shape (L,)
        Whether each of them and its predecessor belong to one marker.

    Examples
    --------
    >>> right_links([0, 0, 0], [0, 0, 1])
    (array([1, 2]), array([ True, False]))
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    before, after = successions(labels)
    marker = truth_labels[after]
    return after, (marker == truth_labels[before]) & (marker >= 0)


def right_identities(
    labels: ArrayLike, truth_labels: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Find the detections in tracks, and whether each is of the marker of most in its track.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.

    Returns
    -------
    inside : ndarray of int, shape (M,)
        Indices of the detections in tracks.
    is_right : ndarray of bool, shape (M,)
        Whether each is of that marker, the lowest if several are equally frequent. Clutter is
        wrong.

    Examples
    --------
    >>> right_identities([0, 0, -1, 0], [2, 2, 1, 1])
    (array([0, 1, 3]), array([ True,  True, False]))
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    pairs = overlap(labels, truth_labels)
    most = np.full(len(pairs.track_sizes), -1)
    rising = np.lexsort((-pairs.markers, pairs.counts))  # the last one is kept
    most[pairs.tracks[rising]] = pairs.markers[rising]
    inside = np.flatnonzero(labels >= 0)
    marker = truth_labels[inside]
    return inside, (marker == most[labels[inside]]) & (marker >= 0)
