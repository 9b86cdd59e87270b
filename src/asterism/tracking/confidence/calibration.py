"""Constants of the confidence, fitted on simulated people by ``benchmarks/calibration.py``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.confidence.parts import Evidence

__all__ = [
    "EXCHANGE",
    "IDENTITY",
    "PART",
    "TRACK",
    "WHOLE",
    "exchange_features",
    "exchange_probability",
    "part_features",
    "part_probability",
    "track_features",
    "track_probability",
]

EXCHANGE = (-1.54, 0.21, 0.76)
"""Log odds of an exchange: constant, factor of its log-likelihood ratio, and of both links."""
PART = (-1.46, 0.93, 0.64, 0.31, 0.28)
"""Log odds that a part is on the marker of its track: constant, and the factors of the margins of
its distances over an unknown marker and over the best other track, of the log odds of the less
certain link or join at its ends, and of the logarithm of its number of detections."""
IDENTITY = (-1.93, 1.22, 0.52, 0.31, 0.29)
"""The same with the margin over an unknown marker by ranges. It is less often wrong about right
parts, and finds fewer wrong ones where a track is on several markers, as before the last
assignment: attempts are compared by `PART`, and the confidence is stated by `IDENTITY`."""
TRACK = (-0.59, 1.65)
"""Log odds that a track without an uncertain link or join is of one marker, not of ghosts:
constant, and factor of the logarithm of its number of detections."""
WHOLE = 0.9999
"""Largest probability of an identity."""
RATIOS = (-10.0, 10.0)
"""Bounds of the log-likelihood ratio of an exchange."""
MARGINS = (-2.0, 4.0)
"""Bounds of the margins for `PART`."""
IN_RANGE = (-6.0, 4.0)
"""Bounds of the margins for `IDENTITY`. An exchange for a third of a track widens its ranges, so
that only the other track shows it."""
EVEN = 1e-4
"""Smallest probability whose log odds are used, and its complement."""


def log_odds(probability: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return log(p / (1 - p)), bounded."""
    p = np.clip(probability, EVEN, 1 - EVEN)
    return np.log(p / (1 - p))


def exchange_features(
    ratio: NDArray[np.float64], is_mutual: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return what the probability of each exchange is computed from, shape (n, 3).

    Parameters
    ----------
    ratio : ndarray of shape (n,)
        Log-likelihood ratio of the exchange by the motion model.
    is_mutual : ndarray of bool, shape (n,)
        Whether both tracks continue after the exchange.
    """
    return np.column_stack(
        [np.ones(len(ratio)), np.clip(ratio, *RATIOS), is_mutual.astype(np.float64)]
    )


def exchange_probability(
    ratio: NDArray[np.float64], is_mutual: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the probability that two tracks have exchanged their later parts.

    Parameters
    ----------
    ratio, is_mutual
        As for `exchange_features`.
    """
    return _probability(exchange_features(ratio, is_mutual) @ np.array(EXCHANGE))


def part_features(
    evidence: Evidence,
    weakest: NDArray[np.float64],
    n_detections: NDArray[np.int64],
    *,
    in_range: bool,
) -> NDArray[np.float64]:
    """Return what the probability of each part is computed from, shape (P, 5).

    Parameters
    ----------
    evidence : Evidence
        Comparison of the distances of the parts.
    weakest : ndarray of shape (P,)
        Probability of the less certain link or join at the ends of each part.
    n_detections : ndarray of int, shape (P,)
        Number of detections of each part.
    in_range : bool
        Whether an unknown marker is compared by ranges, as for `IDENTITY`.
    """
    unknown = evidence.in_range if in_range else evidence.unknown
    bounds = IN_RANGE if in_range else MARGINS
    return np.column_stack(
        [
            np.ones(len(weakest)),
            np.clip(-unknown, *bounds),
            np.clip(-evidence.densities[:, 0], *bounds),
            log_odds(weakest),
            np.log(np.maximum(n_detections, 1)),
        ]
    )


def part_probability(
    features: NDArray[np.float64], factors: tuple[float, ...]
) -> NDArray[np.float64]:
    """Return the probability that parts of tracks are on the marker of their track.

    Parameters
    ----------
    features : ndarray of shape (P, 5)
        Result of `part_features`.
    factors : tuple of float
        `PART`, or `IDENTITY` for features in ranges.
    """
    return _probability(features @ np.array(factors))


def track_features(n_detections: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what the probability of each whole track is computed from, shape (K, 2).

    Parameters
    ----------
    n_detections : ndarray of int, shape (K,)
        Number of detections of each track.
    """
    return np.column_stack([np.ones(len(n_detections)), np.log(np.maximum(n_detections, 1))])


def track_probability(n_detections: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the probability that tracks without an uncertain link are of one marker.

    Parameters
    ----------
    n_detections : ndarray of int, shape (K,)
        As for `track_features`.
    """
    return _probability(track_features(n_detections) @ np.array(TRACK))


def _probability(log_odds: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 / (1 + np.exp(-log_odds))
