"""HOTA: a score with equal weights for detection and association."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics.counts import check_labels, overlap, ratio
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["HotaScores", "hota_scores"]


@record(eq=False)
class HotaScores:
    """Result of `hota_scores`. A share of an empty set is NaN.

    Attributes
    ----------
    hota : float
        Higher-order tracking accuracy, √(deta · assa); 0 without a labelled detection of a marker.
    deta : float
        Detection accuracy: number of labelled detections of markers, divided by the number of
        detections that are labelled or belong to a marker.
    assa : float
        Association accuracy: mean over the labelled detections of markers of the number of
        detections shared by the track and the marker, divided by the number in either.

    Examples
    --------
    >>> hota_scores([0, 0, 1], [0, 0, 0]).deta
    1.0
    """

    hota: float
    deta: float
    assa: float


def hota_scores(labels: ArrayLike, truth_labels: ArrayLike) -> HotaScores:
    """Compute HOTA; labels are matched detection by detection, so localisation is exact.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.

    Returns
    -------
    HotaScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    References
    ----------
    J. Luiten et al.: HOTA: a higher order metric for evaluating multi-object tracking. IJCV, 2021.

    Examples
    --------
    >>> round(hota_scores([0, 0, 1], [0, 0, 0]).hota, 4)
    0.7454
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    pairs = overlap(labels, truth_labels)
    n_matches = int(pairs.counts.sum())
    n_either = int(pairs.marker_sizes.sum() + pairs.track_sizes.sum()) - n_matches
    union = pairs.marker_sizes[pairs.markers] + pairs.track_sizes[pairs.tracks] - pairs.counts
    deta = ratio(n_matches, n_either)
    shared = float(np.sum(pairs.counts * (pairs.counts / union)))
    assa = shared / n_matches if n_matches else deta  # 0, or NaN if there are no detections
    return HotaScores(hota=math.sqrt(deta * assa), deta=deta, assa=assa)
