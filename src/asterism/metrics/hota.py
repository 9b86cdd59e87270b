"""HOTA: detecting and associating weighed alike."""

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
    """What `hota_scores` found. Shares of nothing are NaN; without a match the rest is 0.

    Attributes
    ----------
    hota : float
        √(deta · assa).
    deta : float
        Labelled detections of markers among all that are labelled or of a marker.
    assa : float
        Mean, over those matches, of what their track and marker share among all that either has.
    """

    hota: float
    deta: float
    assa: float


def hota_scores(labels: ArrayLike, truth_labels: ArrayLike) -> HotaScores:
    """Score labels by HOTA; by identity of the detection, all its thresholds of place agree.

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
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    pairs = overlap(labels, truth_labels)
    n_matches = int(pairs.counts.sum())
    n_either = int(pairs.marker_sizes.sum() + pairs.track_sizes.sum()) - n_matches
    union = pairs.marker_sizes[pairs.markers] + pairs.track_sizes[pairs.tracks] - pairs.counts
    deta = ratio(n_matches, n_either)
    shared = float(np.sum(pairs.counts * (pairs.counts / union)))
    assa = shared / n_matches if n_matches else deta  # 0, or NaN if there is nothing at all
    return HotaScores(hota=math.sqrt(deta * assa), deta=deta, assa=assa)
