"""Identity scores: how much of the truth is right if each marker gets one track for good."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics.counts import Overlap, check_labels, overlap, ratio
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["IdentityScores", "identity_scores"]


@record(eq=False)
class IdentityScores:
    """What `identity_scores` found. Shares of nothing are NaN.

    Attributes
    ----------
    idf1 : float
        2 × right / (detections of markers + labelled detections).
    idp : float
        Right share of the labelled detections.
    idr : float
        Right share of the detections of markers.
    n_identified : int
        Right detections: those whose track is the one of their marker.
    """

    idf1: float
    idp: float
    idr: float
    n_identified: int


def identity_scores(labels: ArrayLike, truth_labels: ArrayLike) -> IdentityScores:
    """Score labels under the one-to-one matching of tracks to markers that makes most right.

    Parameters
    ----------
    labels, truth_labels : array_like of int, shape (N,)
        Track and marker of each detection, -1 for none.

    Returns
    -------
    IdentityScores

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    References
    ----------
    E. Ristani et al.: Performance measures and a data set for multi-target, multi-camera tracking.
    ECCV workshops, 2016.
    """
    labels, truth_labels = check_labels(labels, truth_labels)
    pairs = overlap(labels, truth_labels)
    right = _best_total(pairs)
    n_true, n_labelled = int(pairs.marker_sizes.sum()), int(pairs.track_sizes.sum())
    return IdentityScores(
        idf1=ratio(2 * right, n_true + n_labelled),
        idp=ratio(right, n_labelled),
        idr=ratio(right, n_true),
        n_identified=right,
    )


def _best_total(pairs: Overlap) -> int:
    """Give the largest sum of counts in which no marker and no track takes part twice."""
    if not len(pairs.counts):
        return 0
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    # Sparse, because a bad tracker makes a hundred thousand tracks. A full matching exists and
    # leaves rows unmatched at will once each row has a column of its own to fall back on; as every
    # row is matched exactly once, one more on all counts (zeros are no edges) costs nothing.
    markers, rows = np.unique(pairs.markers, return_inverse=True)
    tracks, columns = np.unique(pairs.tracks, return_inverse=True)
    n, own = len(markers), np.arange(len(markers))
    weights = np.concatenate([pairs.counts + 1.0, np.ones(n)])
    places = (np.concatenate([rows, own]), np.concatenate([columns, len(tracks) + own]))
    table = coo_array((weights, places), shape=(n, len(tracks) + n)).tocsr()
    chosen_rows, chosen_columns = min_weight_full_bipartite_matching(table, maximize=True)
    return int(table[chosen_rows, chosen_columns].sum()) - n
