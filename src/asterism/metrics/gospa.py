"""GOSPA: one distance a frame for misses, false labels and errors of place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array, check_number
from asterism.metrics.counts import check_frames, check_labels, ratio
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["GospaScores", "gospa_scores"]


@record(eq=False)
class GospaScores:
    """What `gospa_scores` found.

    Attributes
    ----------
    gospa : float
        Mean over the frames, metres; NaN without a frame.
    frame_gospa : ndarray, shape (T,)
        Of each frame, metres.
    """

    gospa: float
    frame_gospa: NDArray[np.float64]


def gospa_scores(
    labels: ArrayLike,
    truth_labels: ArrayLike,
    frame_of: ArrayLike,
    *,
    c: float = 0.1,
    n_frames: int | None = None,
    error: ArrayLike | None = None,
) -> GospaScores:
    """Score labels by GOSPA with p = 2 and α = 2, pairing by identity of the detection.

    A frame with errors of place e_i, m missed markers and f false labels has
    ``sqrt(Σ min(e_i, c)² + c²/2 · (m + f))``. Which track a label names does not matter to it.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    frame_of : array_like of int, shape (N,)
        Frame of each detection, never decreasing.
    c : float
        Cut-off, metres: an error of place is no worse than this.
    n_frames : int, optional
        Number of frames; up to the last detection unless given.
    error : array_like, shape (N,), optional
        Distance of each detection from the true place of its marker, metres; 0 unless given.

    Returns
    -------
    GospaScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    References
    ----------
    A. S. Rahmathullah, Á. F. García-Fernández, L. Svensson: Generalized optimal sub-pattern
    assignment metric. FUSION, 2017.
    """
    check_number("c", c, above=0)
    labels, truth_labels = check_labels(labels, truth_labels)
    frame_of, n_frames = check_frames(frame_of, len(labels), n_frames)
    is_true, is_labelled = truth_labels >= 0, labels >= 0
    cost = np.where(is_true != is_labelled, c * c / 2, 0.0)
    if error is not None:
        error = check_array("error", error, (len(labels),), finite=False)
        is_match = is_true & is_labelled
        cost[is_match] = np.minimum(error[is_match], c) ** 2
    by_frame = np.sqrt(np.bincount(frame_of, weights=cost, minlength=n_frames))
    return GospaScores(gospa=ratio(float(by_frame.sum()), n_frames), frame_gospa=by_frame)
