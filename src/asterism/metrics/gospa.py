"""GOSPA: a distance for each frame, from missed labels, false labels and position errors."""

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
    """Result of `gospa_scores`.

    Attributes
    ----------
    gospa : float
        Mean GOSPA distance over the frames, metres; NaN without a frame.
    frame_gospa : ndarray of shape (T,)
        GOSPA distance of each frame, metres.

    Examples
    --------
    >>> gospa_scores([0, 0], [0, 0], [0, 1]).gospa
    0.0
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
    """Compute GOSPA with p = 2 and α = 2; labels are matched detection by detection.

    A frame with position errors e_i, m missed markers and f false labels has the distance
    ``sqrt(Σ min(e_i, c)² + c²/2 · (m + f))``. The identity of the tracks has no effect.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.
    frame_of : array_like of int, shape (N,)
        Frame of each detection, in increasing order.
    c : float
        Cut-off, metres, > 0: larger position errors count as c. Larger values weigh missed and
        false labels more.
    n_frames : int, optional
        Number of frames. By default the last frame is that of the last detection.
    error : array_like of shape (N,), optional
        Distance of each detection from the true position of its marker, metres; 0 by default.

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

    Examples
    --------
    >>> scores = gospa_scores([0, -1], [0, 0], [0, 1], c=0.1)
    >>> scores.frame_gospa.round(4)
    array([0.    , 0.0707])
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
