"""The 2010 report's own percentages, and the links they come from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics.counts import check_frames, check_labels, overlap, ratio, successions
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["AssociationScores", "association_scores", "right_links"]


@record(eq=False)
class AssociationScores:
    """What `association_scores` found. Percentages of nothing are NaN.

    Attributes
    ----------
    wrong_percent : float
        Labelled detections whose marker is not their track's, the one it has most often (the
        lowest of several). Labelled clutter is wrong.
    wrong_first_percent : float
        The same where the track's marker is that of its first detection: once it has strayed, all
        that follows is wrong. A track that starts with clutter is wrong throughout.
    missing_percent : float
        Detections of markers without a label.
    clutter_labelled_percent : float
        Clutter (false points, ghosts) with a label.
    n_markers, n_tracks : int
        Markers seen at all, and tracks generated.
    tracks_per_marker : float
        Their ratio, 1 at best.
    wrong_links : int
        Pairs of consecutive detections in a track that are not of one marker.
    broken_links : int
        Pairs of consecutive detections of a marker that are not consecutive in one track.
    frames_by_wrong : tuple of int
        Number of frames with 0, 1, 2 … wrong associations, by the track's commonest marker.
    frame_wrong, frame_wrong_first : ndarray of int, shape (T,)
        Wrong associations by frame, in both senses.
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
    """Score labels as the report does: wrong associations, generated tracks, missing labels.

    The report also counts as wrong what is in a track beyond one for each marker, however pure it
    is; that is ``100 · (1 − idp)`` of `asterism.metrics.identity_scores`.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    frame_of : array_like of int, shape (N,)
        Frame of each detection, never decreasing.
    n_frames : int, optional
        Number of frames; up to the last detection unless given.

    Returns
    -------
    AssociationScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    frame_of, n_frames = check_frames(frame_of, len(labels), n_frames)
    is_true, is_labelled = truth_labels >= 0, labels >= 0
    pairs = overlap(labels, truth_labels)
    n_tracks = len(pairs.track_sizes)

    commonest = np.full(n_tracks, -1)
    rising = np.lexsort((-pairs.markers, pairs.counts))  # the last one written stays
    commonest[pairs.tracks[rising]] = pairs.markers[rising]
    first = np.full(n_tracks, -1)
    members = np.flatnonzero(is_labelled)
    first[labels[members[::-1]]] = truth_labels[members[::-1]]

    by_frame: list[NDArray[np.int64]] = []
    for marker_of in (commonest, first):
        is_right = (marker_of[labels[members]] == truth_labels[members]) & is_true[members]
        by_frame.append(np.bincount(frame_of[members[~is_right]], minlength=n_frames))
    wrong, wrong_first = by_frame

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
    """Tell for each detection that continues a track whether it is of the marker before it.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection in the order of their frames, -1 for none.

    Returns
    -------
    successors : ndarray of int, shape (L,)
        The detections that have a predecessor in their track.
    is_right : ndarray of bool, shape (L,)
        Whether it and its predecessor are of one marker.
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    before, after = successions(labels)
    marker = truth_labels[after]
    return after, (marker == truth_labels[before]) & (marker >= 0)
