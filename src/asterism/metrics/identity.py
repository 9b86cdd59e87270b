"""Identity scores IDF1, IDP and IDR, with at most one track for each marker."""

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
    """Result of `identity_scores`. A share of an empty set is NaN.

    Attributes
    ----------
    idf1 : float
        2 · n_identified / (detections of markers + labelled detections).
    idp : float
        Identity precision: share of the labelled detections that is identified.
    idr : float
        Identity recall: share of the detections of markers that is identified.
    n_identified : int
        Number of identified detections: those whose track is matched to their marker.

    Examples
    --------
    >>> identity_scores([0, 0, 1], [0, 0, 0]).n_identified
    2
    """

    idf1: float
    idp: float
    idr: float
    n_identified: int


def identity_scores(labels: ArrayLike, truth_labels: ArrayLike) -> IdentityScores:
    """Compute identity scores under the best one-to-one matching of tracks to markers.

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

    Examples
    --------
    >>> scores = identity_scores([0, 0, 1], [0, 0, 0])
    >>> round(scores.idf1, 4)
    0.6667
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
    """Return the largest sum of counts in which each marker and track occurs at most once."""
    if not len(pairs.counts):
        return 0
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    # The matrix is sparse, because a bad tracker can make 100 000 tracks. Each row has a further
    # column of its own, so that a full matching exists and a row can stay unmatched. All counts
    # are raised by one, because zeros are not edges; every row is matched once, so the order is
    # kept.
    markers, rows = np.unique(pairs.markers, return_inverse=True)
    tracks, columns = np.unique(pairs.tracks, return_inverse=True)
    n, own = len(markers), np.arange(len(markers))
    weights = np.concatenate([pairs.counts + 1.0, np.ones(n)])
    places = (np.concatenate([rows, own]), np.concatenate([columns, len(tracks) + own]))
    table = coo_array((weights, places), shape=(n, len(tracks) + n)).tocsr()
    chosen_rows, chosen_columns = min_weight_full_bipartite_matching(table, maximize=True)
    return int(table[chosen_rows, chosen_columns].sum()) - n
