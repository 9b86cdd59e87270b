"""CLEAR-MOT scores: missed detections, false positives and identity switches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array
from asterism.metrics.counts import check_frames, check_labels, ratio, successions
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["ClearScores", "clear_scores"]


@record(eq=False)
class ClearScores:
    """Result of `clear_scores`. A share of an empty set is NaN.

    Attributes
    ----------
    n_true : int
        Number of detections of markers.
    mota : float
        1 − (missed + false_labels + switches) / n_true; at most 1, may be negative.
    motp_mm : float
        Mean distance of the labelled detections of markers from the true positions, millimetres;
        0 if no true positions are given.
    missed : int
        Number of detections of markers without a label (false negatives).
    false_labels : int
        Number of labelled clutter detections (false positives).
    switches : int
        Number of times that the track of a marker differs from that of its last labelled
        detection.
    switches_per_1000 : float
        Number of switches per 1000 detections of markers.
    fragments : int
        Number of times that a marker's labels end and resume, with an unlabelled detection
        between.
    mostly_tracked, mostly_lost : int
        Number of markers of which at least 80 % of the detections are labelled; less than 20 %.
    frame_true, frame_missed, frame_false, frame_switches : ndarray of int, shape (T,)
        Counts in each frame; a switch counts in the frame of its second label.

    Examples
    --------
    >>> clear_scores([0, 0, 1], [0, 0, 0], [0, 1, 2]).switches
    1
    """

    n_true: int
    mota: float
    motp_mm: float
    missed: int
    false_labels: int
    switches: int
    switches_per_1000: float
    fragments: int
    mostly_tracked: int
    mostly_lost: int
    frame_true: NDArray[np.int64]
    frame_missed: NDArray[np.int64]
    frame_false: NDArray[np.int64]
    frame_switches: NDArray[np.int64]


def clear_scores(
    labels: ArrayLike,
    truth_labels: ArrayLike,
    frame_of: ArrayLike,
    *,
    n_frames: int | None = None,
    error: ArrayLike | None = None,
) -> ClearScores:
    """Compute the CLEAR-MOT scores of labels; labels are matched detection by detection.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    frame_of : array_like of int, shape (N,)
        Frame of each detection, in increasing order.
    n_frames : int, optional
        Number of frames. By default the last frame is that of the last detection.
    error : array_like of shape (N,), optional
        Distance of each detection from the true position of its marker, metres; 0 by default.
        Only labelled detections of markers are used.

    Returns
    -------
    ClearScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    References
    ----------
    K. Bernardin, R. Stiefelhagen: Evaluating multiple object tracking performance: the CLEAR MOT
    metrics. EURASIP Journal on Image and Video Processing, 2008.

    Examples
    --------
    >>> scores = clear_scores([0, -1, 1], [0, 0, 0], [0, 1, 2])
    >>> scores.missed, scores.switches
    (1, 1)
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    frame_of, n_frames = check_frames(frame_of, len(labels), n_frames)
    is_true, is_labelled = truth_labels >= 0, labels >= 0
    is_match, is_missed, is_false = (
        is_true & is_labelled,
        is_true & ~is_labelled,
        is_labelled & ~is_true,
    )

    before, after = successions(np.where(is_match, truth_labels, -1))
    switched = after[labels[before] != labels[after]]
    before, after = successions(truth_labels)
    n_interrupted = np.count_nonzero(is_match[before] & ~is_match[after])
    # The last interruption of a marker is not a fragment if no label follows it.
    seen = np.bincount(truth_labels[is_true])
    matched = np.bincount(truth_labels[is_match], minlength=len(seen))
    last = np.full(len(seen), -1)
    last[truth_labels[is_true]] = np.flatnonzero(is_true)  # in time order: the last is kept
    last = last[matched > 0]
    fragments = n_interrupted - np.count_nonzero(~is_match[last])

    n_true, n_missed, n_false = (int(np.count_nonzero(x)) for x in (is_true, is_missed, is_false))
    distance = 0.0
    if error is not None:
        error = check_array("error", error, (len(labels),), finite=False)[is_match]
        distance = ratio(float(error.sum()), len(error))

    def by_frame(frames: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.bincount(frames, minlength=n_frames)

    return ClearScores(
        n_true=n_true,
        mota=1 - ratio(n_missed + n_false + len(switched), n_true),
        motp_mm=1000 * distance,
        missed=n_missed,
        false_labels=n_false,
        switches=len(switched),
        switches_per_1000=1000 * ratio(len(switched), n_true),
        fragments=int(fragments),
        mostly_tracked=int(np.count_nonzero((matched >= 0.8 * seen) & (seen > 0))),
        mostly_lost=int(np.count_nonzero(matched < 0.2 * seen)),
        frame_true=by_frame(frame_of[is_true]),
        frame_missed=by_frame(frame_of[is_missed]),
        frame_false=by_frame(frame_of[is_false]),
        frame_switches=by_frame(frame_of[switched]),
    )
