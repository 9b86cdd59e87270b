"""Search for the names of tracks that exist at the same time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.tracking.naming.evidence import (
    FIRST_WEIGHTS,
    NONE,
    ROUGH_WEIGHTS,
    TrackStats,
    evidence_of,
    refit,
    rigid_fit,
)
from asterism.tracking.naming.posture import posture_log_odds
from asterism.tracking.naming.starts import starts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet
    from asterism.model.upwards import Axis

__all__ = ["Found", "search"]

REFINED = 3
"""Number of results of the rough search that are refined."""
SAME_SIZE, SAME_WEIGHT = 0.002, 0.05
"""Differences of the size and of a weight up to which the evidence is not computed again."""
MIN_FIT = -0.95
"""Smallest fit of a track's rigid distances to its name (`rigid_fit`). Other points of a body that
are near a marker which is not worn have -1.0 and less, right names -0.85 and more."""
MAX_REFUSED = 0.15
"""Largest share of the tracks whose names are refused at a time: where more do not fit, the set is
another subject's."""
REFUSED = -99.0
"""Log odds of a name that a track cannot have."""
ROUNDS = 5
"""Number of times that names are searched without those that do not fit."""
ONE_SIDE = -2
"""Partner of a marker with a side whose partner is not in the set."""
IN_TURN = 5
"""Number of nearest tracks with which a track may exchange names in turn."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """Names of n tracks that exist at the same time."""

    names: NDArray[np.int64]  # (n,), marker of each track, -1 for none
    score: float  # log odds of all names together
    size: float  # of the subject relative to the marker set
    weights: tuple[float, ...]  # of the four kinds of fit of a distance
    evidence: _engine.NameEvidence
    mean_log_odds: float  # of a distance between two named tracks
    refused: NDArray[np.bool_]  # (n, M), names that a track's rigid distances contradict
    fit: float  # score relative to that of tracks at exactly the distances of the set


def search(
    made: MarkerSet,
    positions: NDArray[np.float64],
    up: Axis,
    start: NDArray[np.int64] | None = None,
    labelled: NDArray[np.float64] | None = None,
) -> Found | None:
    """Search for the names of tracks that exist at the same time; None where nothing can start.

    Parameters
    ----------
    made : MarkerSet
        Markers of one subject.
    positions : ndarray of shape (T, n, 3)
        Positions of the tracks, metres, NaN without a detection.
    up : {"x", "y", "z"}
        Axis of the capture that points up.
    start : ndarray of int, shape (n,), optional
        Names from which the search starts instead, nearly right.
    labelled : ndarray of shape (n, M), optional
        Log odds of each marker for each track by the names that the capture has itself.

    Notes
    -----
    The posture of the set is laid over the points in several ways. From each of these starts a
    search with wide tolerances settles; the best results are refined with the weights and the size
    that fit them. The search is a local one: it ends where no move improves the score
    (`engine/naming/name_search.hpp`).
    """
    first = [start] if start is not None else starts(made, positions, up)
    if not first:
        return None
    stats = TrackStats.of(positions)
    groups, near = _groups(made), stats.near(IN_TURN)
    has_side = np.array([side is not None for side in made.sides])
    partner = np.array(made.partners, dtype=np.int64)
    partner[has_side & (partner < 0)] = ONE_SIDE

    def searching(evidence: _engine.NameEvidence) -> _engine.NameSearch:
        return _engine.NameSearch(evidence, groups=groups, partner=partner, near=near)

    if start is None:
        rough = searching(evidence_of(made, stats, size=1.0, weights=ROUGH_WEIGHTS))
        settled: dict[bytes, tuple[float, NDArray[np.int64]]] = {}
        for names in first:
            names, score = rough.settled(names)
            settled[names.tobytes()] = (score, names)
        first = [n for _, n in sorted(settled.values(), key=lambda item: -item[0])[:REFINED]]
        first = [rough.improved(first[0])[0], *first]
    size, weights = refit(made, stats, first[0]) or (1.0, FIRST_WEIGHTS)
    fine = searching(evidence_of(made, stats, size=size, weights=weights, more=labelled))
    names, _ = max((fine.settled(names) for names in first), key=lambda item: item[1])
    again = refit(made, stats, names)
    if again is not None and _differs(again, (size, weights)):
        size, weights = again
        fine = searching(evidence_of(made, stats, size=size, weights=weights, more=labelled))
    names, _ = fine.improved(names)
    refused = np.zeros((len(names), len(made)), dtype=bool)

    def with_posture(
        names: NDArray[np.int64],
    ) -> tuple[NDArray[np.int64], float, _engine.NameEvidence, NDArray[np.float64]]:
        # After the names, because a posture that wrong names have laid would keep them.
        more = posture_log_odds(made, stats.positions, names, up, size)
        more = np.where(refused, REFUSED, more if labelled is None else more + labelled)
        evidence = evidence_of(made, stats, size=size, weights=weights, more=more)
        return *searching(evidence).improved(names), evidence, more

    names, score, evidence, more = with_posture(names)
    # How well the set fits is judged with the names that are refused below.
    at_the_set = _at_the_set(made, stats, names, size)
    exact = evidence_of(made, at_the_set, size=size, weights=weights, more=more)
    n_named = int((names >= 0).sum())
    n_pairs = int((names >= 0)[stats.pairs].all(axis=1).sum())
    of_named, best = score + NONE * n_named, exact.total(names) + NONE * n_named
    for n in range(ROUNDS):
        fit = rigid_fit(made, stats, names, size, weights)
        wrong = np.flatnonzero((names >= 0) & (fit < MIN_FIT))
        if not 0 < len(wrong) <= MAX_REFUSED * len(names):
            break
        refused[wrong, names[wrong]] = True
        names = names.copy()
        names[wrong] = -1
        if n < ROUNDS - 1:
            names, score, evidence, _ = with_posture(names)
        else:  # what still does not fit has no name
            score = evidence.total(names)
    return Found(
        names=names,
        score=score,
        size=size,
        weights=weights,
        evidence=evidence,
        mean_log_odds=of_named / max(n_pairs, 1),
        fit=of_named / best if best > 0 else 0.0,
        refused=refused,
    )


def _at_the_set(
    made: MarkerSet, stats: TrackStats, names: NDArray[np.int64], size: float
) -> TrackStats:
    """Return the tracks as if their distances were those of the markers that they are named."""
    i, j = stats.pairs.T
    middle = stats.distances.middle.copy()
    exact = np.where((names[i] >= 0) & (names[j] >= 0), made.distances[names[i], names[j]], np.nan)
    known = np.isfinite(exact)
    middle[i[known], j[known]] = size * exact[known]
    return replace(stats, distances=replace(stats.distances, middle=middle))


def _differs(one: tuple[float, tuple[float, ...]], other: tuple[float, tuple[float, ...]]) -> bool:
    """Return whether two fits of size and weights differ enough to change log odds."""
    size = abs(one[0] - other[0]) > SAME_SIZE
    return size or max(abs(a - b) for a, b in zip(one[1], other[1], strict=True)) > SAME_WEIGHT


def _groups(made: MarkerSet) -> list[list[int]]:
    """Return groups of near markers of one side: all branches of a tree of nearest neighbours.

    A group is moved together with its partners on the other side. Markers without a partner are
    grouped too; they are left without names and named anew.
    """
    from scipy.cluster.hierarchy import linkage
    from scipy.spatial.distance import squareform

    partner = made.partners
    own = [m for m in range(len(made)) if partner[m] < 0 or m < partner[m]]
    if len(own) < 2:
        return [own] if own else []
    distances = made.distances[np.ix_(own, own)]
    distances = np.where(np.isfinite(distances), distances, 10.0)
    np.fill_diagonal(distances, 0.0)
    tree = linkage(squareform(distances, checks=False), "single")
    groups = [[m] for m in own]
    for first, second in tree[:, :2].astype(np.int64):
        groups.append([*groups[first], *groups[second]])
    return groups[::-1]
