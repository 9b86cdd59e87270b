"""Probabilities of names, from the log odds of the changes that would replace them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.naming.search import Found

__all__ = ["marker_odds", "probabilities_of", "track_odds"]

TEMPERATURE = 4.0
"""Factor by which the log odds of names are too large, because the distances of neighbours vary
together."""
COMPARED = 3
"""Number of exchanges of each track whose exact score is computed, the most promising ones."""
INDEPENDENT = 3
"""Number of windows after which more of them add nothing: errors of a marker set stay the same."""


def marker_odds(found: Found, n_markers: int) -> NDArray[np.float64]:
    """Return the log odds of other names for each marker, (M, M), -inf where not compared.

    Parameters
    ----------
    found : Found
        Names of one track for each marker.
    n_markers : int
        Number of markers M.
    """
    names = found.names
    odds = np.full((n_markers, n_markers), -np.inf)
    scores = found.evidence.scores(names)
    named = np.flatnonzero(names >= 0)
    own = scores[named, names[named]]
    first_order = scores[np.ix_(named, names[named])] - own[:, None]
    first_order += first_order.T
    np.fill_diagonal(first_order, -np.inf)
    base = found.evidence.total(names)
    for i in range(len(named)):
        for j in np.argsort(-first_order[i], kind="stable")[:COMPARED]:
            if not np.isfinite(first_order[i, j]):
                continue
            exchanged = names.copy()
            exchanged[named[[i, j]]] = names[named[[j, i]]]
            gain = found.evidence.total(exchanged) - base
            a, b = names[named[i]], names[named[j]]
            odds[a, b] = odds[b, a] = gain
        free = np.setdiff1d(np.arange(n_markers), names)
        a = names[named[i]]
        odds[a, free] = np.maximum(odds[a, free], scores[named[i], free] - own[i])
    return odds


def track_odds(sums: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the log odds of each track for other names, from sums over its windows.

    Parameters
    ----------
    sums : ndarray of shape (K, ...)
        Sum of the gains over the windows of each track.
    counts : ndarray of int, shape (K,)
        Number of windows of each track.
    """
    share = np.minimum(counts, INDEPENDENT) / np.maximum(counts, 1)
    return sums * share.reshape(-1, *(1,) * (sums.ndim - 1))


def probabilities_of(
    markers: NDArray[np.int64],
    of_markers: NDArray[np.float64],
    of_tracks: NDArray[np.float64],
    of_none: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the probability of each name, the best alternative with its own, and that of none.

    Parameters
    ----------
    markers : ndarray of int, shape (K,)
        Marker of each track, -1 for none.
    of_markers : ndarray of shape (M, M)
        Log odds of other names for all tracks of one name together.
    of_tracks : ndarray of shape (K, M)
        Log odds of other names for each track.
    of_none : ndarray of shape (K,)
        Log odds of no name for each track.
    """
    K = len(of_tracks)
    probability, other, none = np.zeros(K), np.full(K, -1), np.ones(K)
    other_probability = np.zeros(K)
    for k in np.flatnonzero(markers >= 0):
        odds = np.logaddexp(of_markers[markers[k]], of_tracks[k])
        odds[markers[k]] = -np.inf
        weights = np.exp(np.minimum(np.append(odds, of_none[k]) / TEMPERATURE, 50.0))
        total = 1 + weights.sum()
        probability[k], none[k] = 1 / total, weights[-1] / total
        other[k] = int(np.argmax(weights[:-1])) if len(weights) > 1 else -1
        other_probability[k] = weights[other[k]] / total if other[k] >= 0 else 0.0
    return probability, other, other_probability, none
