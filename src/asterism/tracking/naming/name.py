"""Which track is which marker of an earlier take: by the distances that they keep."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.records import record
from asterism.tracking.rigidity.bonds import MOST_FRAMES, Bonds
from asterism.tracking.rigidity.distances import MIN_TOGETHER, distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Naming", "name_tracks"]

BEAM = 400
"""Ways of naming the tracks that are followed at once."""
LOOKED_AT = 12
"""Named tracks that an unnamed one is compared with, the steadiest first."""
REPLACED = 0.004, 0.015
"""Markers may be stuck on anew between takes: metres, and share of the distance …"""
LEFT = 0.0005, 0.0
"""… or be left where they were. What fits better counts."""
POSED = 0.02, 0.25
"""What the distance of two that have no bond may differ by from that in the pose: metres, share."""
ANYWHERE = 2.0
"""Metres over which the distances of markers that are not the ones meant are spread."""
LEAST, MOST = -3.0, 7.0
"""What one distance, or one side, says at most: log odds …"""
UNBONDED = -0.5, 0.0
"""… and where there is no bond: bodies move apart."""
ENOUGH = 10.0
"""Log odds from which a track that is left over is a piece of a named one."""
WORTH = 0.25
"""Distances bend together: what they say is worth less than their sum."""


@record(eq=False)
class Naming:
    """Tracks named after the markers of an earlier take.

    Parameters
    ----------
    tracks : Tracks
        Tracks that are the same marker made one, and named.
    markers : ndarray of int, shape (K,)
        Of each track that came in, its marker in the bonds, -1 where none is named.
    probabilities : ndarray, shape (K,)
        That it is that one, against the others that were weighed; 0 where none is named.
    """

    tracks: Tracks
    markers: NDArray[np.int64]
    probabilities: NDArray[np.float64]

    @property
    def n_named(self) -> int:
        """Number of tracks that were named."""
        return int((self.markers >= 0).sum())

    def __repr__(self) -> str:
        return f"Naming({self.n_named} of {len(self.markers)} tracks)"


def name_tracks(tracks: Tracks, bonds: Bonds) -> Naming:
    """Name tracks after the markers of an earlier take of the same body.

    Two tracks that keep a distance are two markers that kept about the same. Tracks are named one
    by one, each beside those to which it keeps its distance best, and the best few hundred ways of
    naming all so far are followed (beam search). On which side of three others a marker lies tells
    a body from its mirror image. Names that the tracks have play no part.

    Parameters
    ----------
    tracks : Tracks
        From `identify` or `stitch` say; short pieces are told from longer ones.
    bonds : Bonds
        From `learn_bonds`.

    Returns
    -------
    Naming

    Raises
    ------
    ParameterError
        If the tracks have another number of axes than the bonds.

    Notes
    -----
    A distance says ``log t(z) / s - log 1/R`` with three degrees of freedom, z what it is off in
    units of s: what it varied by in both takes and what a marker moves when it is stuck on anew.
    It is bounded, so that one wrong distance is outvoted.
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("bonds", bonds, Bonds, "am.learn_bonds(tracks)")
    if tracks.detections.n_axes != bonds.places.shape[1]:
        expected = f"{bonds.places.shape[1]} axes, as the bonds have"
        raise ParameterError("tracks", expected, tracks.detections.n_axes)
    take = _Take.of(tracks)
    named, probabilities = _search(take, _Known.of(bonds))
    _name_pieces(take, _Known.of(bonds), named, probabilities)
    markers = np.full(tracks.n_tracks, -1, dtype=np.int64)
    sure = np.zeros(tracks.n_tracks)
    markers[take.tracks], sure[take.tracks] = named, probabilities
    return Naming(tracks=_renamed(tracks, markers, bonds), markers=markers, probabilities=sure)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Take:
    """The tracks that are long enough: n of them."""

    tracks: NDArray[np.int64]
    positions: NDArray[np.float64]  # (F, n, D)
    middle: NDArray[np.float64]  # (n, n), NaN where two were not seen together for long
    spread: NDArray[np.float64]
    variance: NDArray[np.float64]  # predictive; infinite where they were not
    seen: NDArray[np.bool_]  # (T, n)

    @classmethod
    def of(cls, tracks: Tracks) -> _Take:
        d = tracks.detections
        every = max(1, -(-d.n_frames // MOST_FRAMES))
        chosen = np.flatnonzero(tracks.lengths >= MIN_TOGETHER)
        dense = tracks.positions()[:, chosen]
        seen = np.isfinite(dense[..., 0])
        between = distances_between(dense[::every])
        is_known = between.n_frames * every >= MIN_TOGETHER
        np.fill_diagonal(is_known, val=False)
        return cls(
            tracks=chosen,
            positions=dense[::every],
            middle=np.where(is_known, between.middle, np.nan),
            spread=np.where(is_known, between.spread, np.nan),
            variance=np.where(is_known, between.predictive_variance, np.inf),
            seen=seen,
        )

    def order(self) -> list[int]:
        """Give the order of naming: each track as steady as can be beside those before."""
        cost = np.sqrt(self.variance)
        n = len(cost)
        if n == 0:
            return []
        nearest = np.sort(cost, axis=1)[:, : min(4, n)].sum(axis=1)
        order = [int(np.argmin(nearest))]
        best = cost[order[0]].copy()
        best[order[0]] = np.nan
        while len(order) < n:
            k = int(np.nanargmin(best))
            order.append(k)
            best = np.fmin(best, cost[k])
            best[order] = np.nan
        return order

    def beside(self, k: int, others: list[int]) -> list[int]:
        """Give those of `others` to which a track keeps its distance best."""
        known = [b for b in others if np.isfinite(self.middle[k, b])]
        return [known[b] for b in np.argsort(self.variance[k, known], kind="stable")[:LOOKED_AT]]

    def height(self, k: int, three: list[int]) -> tuple[float, float]:
        """Measure how high a track lies over the plane of three others: median and spread."""
        a, b, c = (self.positions[:, i] for i in three)
        values = _height(self.positions[:, k], a, b, c)
        values = np.sort(values[np.isfinite(values)])
        if len(values) < 3:
            return np.nan, np.nan
        low, middle, high = values[(np.array([0.16, 0.5, 0.84]) * len(values)).astype(int)]
        return float(middle), float(high - low) / 2


@dataclass(frozen=True, eq=False, kw_only=True)
class _Known:
    """The bonds as tables over K markers; of pairs without one, what the pose says."""

    is_bond: NDArray[np.bool_]  # (K, K)
    distance: NDArray[np.float64]
    spread: NDArray[np.float64]
    places: NDArray[np.float64]  # (K, D)

    @classmethod
    def of(cls, bonds: Bonds) -> _Known:
        K = len(bonds.names)
        distance = np.linalg.norm(bonds.places[:, None] - bonds.places[None], axis=2)
        spread = POSED[0] + POSED[1] * distance
        is_bond = np.zeros((K, K), dtype=bool)
        for pairs in (bonds.pairs, bonds.pairs[:, ::-1]):
            at = tuple(pairs.T)
            distance[at], spread[at], is_bond[at] = bonds.distances, bonds.spreads, True
        return cls(is_bond=is_bond, distance=distance, spread=spread, places=bonds.places)

    def log_odds(self, middle: float, spread: float) -> NDArray[np.float64]:
        """Tell for all pairs of markers whether two tracks are these, (K, K)."""
        varied = spread**2 + self.spread**2
        said = np.nan_to_num(_log_odds(middle - self.distance, varied, self.distance))
        return np.where(self.is_bond, said, said.clip(*UNBONDED))


def _log_odds(
    off: NDArray[np.float64], varied: NDArray[np.float64], size: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Student's t with three degrees of freedom against anywhere, bounded."""
    scale2 = np.stack([varied + (fixed + share * size) ** 2 for fixed, share in (LEFT, REPLACED)])
    log_t = -2 * np.log1p(off**2 / scale2 / 3) - 0.5 * np.log(scale2) - 1.0  # log t(0) = -1.0
    said = log_t.max(axis=0) + np.log(ANYWHERE)
    return np.clip(said, LEAST, MOST)


def _height(
    x: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
) -> NDArray[np.float64]:
    """How high x lies over the plane through a, b and c, on its right-handed side."""
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return ((x - a) * normal).sum(axis=-1) / length


def _search(take: _Take, known: _Known) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Name the tracks: the best way, and how probable each name is among the ways left."""
    n, K = len(take.tracks), len(known.places)
    named = np.full((1, n), -1, dtype=np.int64)
    is_used = np.zeros((1, K), dtype=bool)
    score = np.zeros(1)
    done: list[int] = []
    for k in take.order():
        others = take.beside(k, done)
        more = _evidence(take, known, k, others, named)
        more[is_used] = -np.inf
        total = np.concatenate([score[:, None] + more, score[:, None]], axis=1)
        best = np.argsort(-total, axis=None, kind="stable")[:BEAM]
        best = best[np.isfinite(total.ravel()[best])]
        way, marker = np.divmod(best, K + 1)
        score, named, is_used = total.ravel()[best], named[way].copy(), is_used[way].copy()
        is_named = marker < K
        named[is_named, k] = marker[is_named]
        is_used[np.flatnonzero(is_named), marker[is_named]] = True
        done.append(k)
    weights = np.exp(WORTH * (score - score.max()))
    weights /= weights.sum()
    best_way = named[int(np.argmax(score))]
    probabilities = ((named == best_way) * weights[:, None]).sum(axis=0)
    return best_way.copy(), np.where(best_way >= 0, probabilities, 0)


def _evidence(
    take: _Take, known: _Known, k: int, others: list[int], named: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Log odds of each marker for a track, in each way of naming the others, shape (ways, K)."""
    ways, K = len(named), len(known.places)
    out = np.zeros((ways, K))
    for b in others:
        table = known.log_odds(float(take.middle[k, b]), float(take.spread[k, b]))
        has = named[:, b] >= 0
        out[has] += table[:, named[has, b]].T
    if known.places.shape[1] == 3 and len(others) >= 3:
        out += _sides(take, known, k, others, named)
    return out


def _sides(
    take: _Take, known: _Known, k: int, others: list[int], named: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Log odds by the side of three others on which a track lies, reversed in a mirror image."""
    out = np.zeros((len(named), len(known.places)))
    for three in ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]):
        if max(three) >= len(others):
            continue
        chosen = [others[i] for i in three]
        height, spread = take.height(k, chosen)
        if not spread < 0.5 * abs(height):
            continue
        own = named[:, chosen]
        has = (own >= 0).all(axis=1)
        a, b, c = (known.places[own[has, i]][:, None] for i in range(3))
        there = _height(known.places[None], a, b, c)
        bent = np.full(there.shape, (2 * spread + 0.2 * abs(height)) ** 2)
        out[has] += np.nan_to_num(_log_odds(height - there, bent, 0.0))
    return out


def _name_pieces(
    take: _Take,
    known: _Known,
    named: NDArray[np.int64],
    probabilities: NDArray[np.float64],
) -> None:
    """Tell of what is left over which named track it is a piece of, in place."""
    counts = take.seen.sum(axis=0)
    for k in sorted(np.flatnonzero(named < 0), key=lambda k: -counts[k]):
        has = np.flatnonzero(named >= 0)
        others = take.beside(int(k), has.tolist())
        if not others:
            continue
        said = _evidence(take, known, int(k), others, named[None])[0]
        # Whoever is seen at the same time is another.
        at_once = (take.seen[:, has] & take.seen[:, [k]]).any(axis=0)
        said[named[has[at_once]]] = -np.inf
        best = int(np.argmax(said))
        if said[best] < ENOUGH:
            continue
        weights = np.exp(WORTH * (said - said[best]))
        named[k], probabilities[k] = best, 1 / (weights.sum() + np.exp(-WORTH * said[best]))


def _renamed(tracks: Tracks, markers: NDArray[np.int64], bonds: Bonds) -> Tracks:
    """Make one of the tracks that are the same marker, and give them its name."""
    into = np.arange(tracks.n_tracks)
    for marker in np.unique(markers[markers >= 0]):
        same = np.flatnonzero(markers == marker)
        into[same] = same[0]
    kept, into = np.unique(into, return_inverse=True)
    labels = np.where(tracks.labels >= 0, into[tracks.labels], -1)
    names = [bonds.names[markers[k]] if markers[k] >= 0 else None for k in kept]
    return replace(tracks, labels=labels, names=tuple(names))
