"""Evidence for names: distances and heights of tracks against those of a marker set.

The engine holds the evidence and searches with it (`engine/naming/`). The score of an assignment
is the sum of the log odds of all distances between near tracks and of the heights of tracks over
the planes of three others. `tests/references/naming.py` computes it slowly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.marker_geometry import quad_sizes
from asterism.tracking.rigidity.distances import Distances, distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet

__all__ = [
    "FIRST_WEIGHTS",
    "NONE",
    "ROUGH_WEIGHTS",
    "TrackStats",
    "evidence_of",
    "prior_of",
    "refit",
    "rigid_fit",
]

NEIGHBOURS = 16
"""Number of neighbours of a track whose distances are evidence."""
DISTANCE_FRAMES, HEIGHT_FRAMES = 100, 6
"""Numbers of frames in which distances and heights of tracks are measured."""
MIN_COMMON = 3
"""Smallest number of common frames of two tracks whose distance is evidence."""
STEADY = 0.1
"""Share of a distance that is added to its spread where neighbours are ordered."""
FIRST_WEIGHTS = (0.3, 0.5, 0.2, 0.2)
"""Prior weights of the four kinds of fit of a distance (`engine/naming/distance_evidence.hpp`):
markers kept in place, attached again or of another subject, another posture, loose."""
ROUGH_WEIGHTS = (0.0, 0.4, 0.4, 0.2)
"""The same for a first search, which must not stop at the first distances that fit exactly."""
RIGID_SHARE = 0.7
"""Weight of the first two kinds together once their ratio is fitted to the capture."""
RIGID_SPREAD = 0.006
"""Spread of a distance, metres, below which it serves for this fit."""
MIN_RIGID = 20
"""Smallest number of such distances."""
NONE = -8.0
"""Log odds below which a track has no name: a long track is more probably a marker."""
PRIOR = 6.0
"""Factor on the log of a marker's presence, because the log odds of distances, which vary together,
are too large as well."""
RARE = 0.01
"""Smallest presence that differs from none."""
UNKNOWN_HEIGHT = 0.012, 0.3
"""Standard deviation of a height whose spread is unknown: metres, and share of the height."""
HEIGHT_ERROR = 0.006, 0.15
"""Standard deviation that is added to every known height: metres, and share."""
NEAR = 0.3
"""Size of a quad, metres, from which on its height tells little if its spread is unknown."""
ACROSS = 0.1
"""Weight of a height across segments, relative to that within a segment, if its spread is unknown:
the other posture may have it on the other side."""
FITS = ((0.004, 0.01, False), (0.008, 0.05, True), (0.03, 0.15, True))
"""Fixed and relative error of the first three kinds, and whether they scale with the subject."""
STEADIEST = 0.004
"""Spread of a distance, metres, at which it counts a quarter in the fit of a name."""
MIN_RIGID_WEIGHT = 0.5
"""Smallest sum of these weights by which a name is judged."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackStats:
    """Distances between n tracks, and their positions in a few frames."""

    distances: Distances
    positions: NDArray[np.float64]  # (F, n, 3)
    pairs: NDArray[np.int64]  # (P, 2), whose distances are evidence

    @classmethod
    def of(cls, positions: NDArray[np.float64]) -> TrackStats:
        """Measure tracks from dense positions, (T, n, 3)."""
        found = distances_between(_sampled(positions, DISTANCE_FRAMES))
        n = len(found.middle)
        cost = found.spread + STEADY * found.middle
        cost[(found.n_frames < MIN_COMMON) | np.eye(n, dtype=bool)] = np.inf
        nearest = np.argsort(cost, axis=1, kind="stable")[:, :NEIGHBOURS]
        chosen = np.zeros((n, n), dtype=bool)
        np.put_along_axis(chosen, nearest, values=True, axis=1)
        chosen &= np.isfinite(cost)
        pairs = np.stack(np.nonzero(np.triu(chosen | chosen.T)), axis=1)
        return cls(distances=found, positions=_sampled(positions, HEIGHT_FRAMES), pairs=pairs)

    def near(self, n: int) -> list[list[int]]:
        """Return for each track its n nearest tracks."""
        middle = np.where(np.isfinite(self.distances.middle), self.distances.middle, np.inf)
        np.fill_diagonal(middle, np.inf)
        order = np.argsort(middle, axis=1, kind="stable")[:, :n]
        return [
            [int(k) for k in row if np.isfinite(own[k])]
            for row, own in zip(order, middle, strict=True)
        ]


def evidence_of(
    made: MarkerSet,
    stats: TrackStats,
    *,
    size: float,
    weights: tuple[float, ...],
    more: NDArray[np.float64] | None = None,
) -> _engine.NameEvidence:
    """Return the evidence for the names of tracks.

    Parameters
    ----------
    made : MarkerSet
        Markers of one subject.
    stats : TrackStats
        Tracks.
    size : float
        Size of the subject relative to the marker set.
    weights : tuple of float
        Weights of the four kinds of fit of a distance.
    more : ndarray of shape (n, M), optional
        Log odds of each marker for each track by its place, or by the names of the capture.
    """
    assert made.quads is not None
    known = np.isfinite(made.height_spreads)
    error = np.where(known[:, None], HEIGHT_ERROR, UNKNOWN_HEIGHT)
    variance = error[:, 0] ** 2 + (error[:, 1] * made.heights) ** 2
    variance += np.where(known, made.height_spreads, 0) ** 2
    weight = np.exp(-((quad_sizes(made.quads, made.distances) / NEAR) ** 2))
    segments = np.unique(np.array(made.segments, dtype=str), return_inverse=True)[1]
    weight[np.ptp(segments[made.quads], axis=1) > 0] *= ACROSS
    weight = np.where(known, 1.0, np.nan_to_num(weight))
    usable = np.isfinite(made.heights)
    i, j = stats.pairs.T
    n = len(stats.distances.middle)
    return _engine.NameEvidence(
        distances=made.distances,
        movements=made.movements,
        variations=np.nan_to_num(made.variations),
        prior=np.tile(prior_of(made), (n, 1)) + (0.0 if more is None else more),
        quads=np.ascontiguousarray(made.quads[usable]),
        heights=np.ascontiguousarray(np.stack([made.heights, variance, weight], axis=1)[usable]),
        pairs=stats.pairs,
        pair_distances=stats.distances.middle[i, j],
        pair_spreads=stats.distances.spread[i, j],
        positions=np.ascontiguousarray(stats.positions),
        spreads=np.where(stats.distances.n_frames > 0, stats.distances.spread, np.nan),
        size=size,
        weights=np.array(weights),
        none=NONE,
    )


def prior_of(made: MarkerSet) -> NDArray[np.float64]:
    """Return the log odds of each marker by its presence in other captures, (M,), at most 0."""
    return PRIOR * np.log((made.presences + RARE) / (1 + RARE))


def refit(
    made: MarkerSet, stats: TrackStats, names: NDArray[np.int64]
) -> tuple[float, tuple[float, ...]] | None:
    """Fit the subject's size, and whether the markers were kept in place, to named tracks.

    Returns
    -------
    size : float
        Median ratio of the rigid distances to those of the marker set.
    weights : tuple of float
        Weights of the four kinds of fit, the first two by expectation-maximisation.
        None with fewer than `MIN_RIGID` rigid distances.
    """
    i, j = stats.pairs.T
    d, s = stats.distances.middle[i, j], stats.distances.spread[i, j]
    a, b = names[i], names[j]
    used = (a >= 0) & (b >= 0) & (s < RIGID_SPREAD)
    used &= np.isfinite(made.distances[a, b]) & (made.distances[a, b] > 0)
    if used.sum() < MIN_RIGID:
        return None
    d, s, a, b = d[used], s[used], a[used], b[used]
    size = float(np.median(d / made.distances[a, b]))
    w = np.array([0.5, 0.5])
    density = _densities(made, d, s, a, b, size)[:2]
    for _ in range(10):
        share_of = w[:, None] * density
        share_of /= share_of.sum(axis=0)
        w = (share_of.sum(axis=1) + 1) / (len(d) + 2)
    rest = (1 - RIGID_SHARE) / 2
    return size, (RIGID_SHARE * float(w[0]), RIGID_SHARE * float(w[1]), rest, rest)


def rigid_fit(
    made: MarkerSet,
    stats: TrackStats,
    names: NDArray[np.int64],
    size: float,
    weights: tuple[float, ...],
) -> NDArray[np.float64]:
    """Return how well the rigid distances of each named track fit its marker, (n,).

    It is the mean log-likelihood ratio of a distance to another named track: of this marker against
    another point nearby, whose distances are off by `FITS[2]`. It is 0 for a track without a name
    or without rigid distances.
    """
    i, j = stats.pairs.T
    used = (names[i] >= 0) & (names[j] >= 0)
    used &= made.distances[names[i], names[j]] > 0
    i, j = i[used], j[used]
    d, s = stats.distances.middle[i, j], stats.distances.spread[i, j]
    density = _densities(made, d, s, names[i], names[j], size)
    ratio = np.log(np.array(weights[:3]) @ density / density[2])
    weight = 1 / (1 + (s / STEADIEST) ** 2) ** 2
    total, sums = np.zeros((2, len(names)))
    for own in (i, j):
        np.add.at(total, own, weight * ratio)
        np.add.at(sums, own, weight)
    return np.where(sums >= MIN_RIGID_WEIGHT, total / np.maximum(sums, MIN_RIGID_WEIGHT), 0.0)


def _densities(
    made: MarkerSet,
    d: NDArray[np.float64],
    s: NDArray[np.float64],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    size: float,
) -> NDArray[np.float64]:
    """Return the densities of distances d of spread s for markers a and b, by kind, (3, P)."""
    D, W, B = made.distances[a, b], made.movements[a, b], np.nan_to_num(made.variations[a, b])
    moved2 = np.where(np.isfinite(W), s**2 / 4 + np.nan_to_num(W) ** 2 / 2, s**2)
    density: list[NDArray[np.float64]] = []
    for fixed, share, scales in FITS:
        v = fixed**2 + (share * D) ** 2 + scales * B**2 + moved2
        y = 1 + (d - (size if scales else 1) * D) ** 2 / (4 * v)
        density.append(0.375 / (np.sqrt(v * y) * y**2))
    return np.stack(density)


def _sampled(positions: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    if len(positions) <= n:
        return positions
    return positions[np.unique(np.linspace(0, len(positions) - 1, n).astype(np.int64))]
