"""Naming of tracks after the markers of an earlier capture, by their stable distances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.records import record
from asterism.tracking.rigidity.bonds import MAX_FRAMES, Bonds
from asterism.tracking.rigidity.distances import MIN_TOGETHER, distances_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Naming", "name_tracks"]

BEAM = 400
"""Number of partial assignments of names that the beam search keeps."""
LOOKED_AT = 12
"""Number of named tracks with which an unnamed one is compared, the steadiest first."""
REPLACED = 0.004, 0.015
"""Standard deviation of a distance if markers were attached again between captures: metres, and
share of the distance."""
LEFT = 0.0005, 0.0
"""The same if the markers were left in place. The better fit of the two is used."""
POSED = 0.02, 0.25
"""Standard deviation of a distance without a bond from that in the pose: metres, and share."""
ANYWHERE = 2.0
"""Range over which the distances of wrong pairs are spread, metres."""
MIN_LOG_ODDS, MAX_LOG_ODDS = -3.0, 7.0
"""Bounds of the log odds of one distance or one side."""
UNBONDED = -0.5, 0.0
"""Bounds of the log odds of a distance without a bond, which varies because bodies move apart."""
ENOUGH = 10.0
"""Smallest log odds at which a remaining track is a piece of a named one."""
WEIGHT = 0.25
"""Factor on the sum of the log odds, because the distances of a body vary together."""


@record(eq=False)
class Naming:
    """Tracks named after the markers of an earlier capture.

    Parameters
    ----------
    tracks : Tracks
        Named tracks; tracks with the same marker are merged.
    markers : ndarray of int, shape (K,)
        Marker of each input track in the bonds, -1 for a track without a name.
    probabilities : ndarray of shape (K,)
        Probability of each name among the names considered; 0 for a track without a name. Check
        names with a probability well below 1 by eye.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.fingers(frames=40, seed=1)
    >>> naming = am.name_tracks(truth, am.learn_bonds(truth))
    >>> naming.n_named, naming.tracks.names[:3]
    (23, ('T1', 'T2', 'T3'))
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
    """Name tracks after the markers of an earlier capture of the same body.

    Two tracks with a stable distance are matched to two markers with about the same distance.
    Tracks are named one by one, each from the named tracks with the most stable distances to it.
    A beam search keeps the few hundred best assignments. The side of three other markers on which
    a marker lies distinguishes a body from its mirror image. Existing names are not used.

    Parameters
    ----------
    tracks : Tracks
        Tracks, for example from `track` or `stitch`. Short tracks are named after longer ones.
    bonds : Bonds
        Bonds of the markers, from `learn_bonds`.

    Returns
    -------
    Naming
        Named tracks with the probability of each name.

    Raises
    ------
    ParameterError
        If the tracks have another number of axes than the bonds.

    Notes
    -----
    The log odds of a distance are ``log t(z) / s - log 1/R``: Student's t with three degrees of
    freedom of its error z in units of s, against a uniform distribution over the range R. The scale
    s combines the variation in both captures and the displacement of a marker that is attached
    again. The log odds are bounded, so that one wrong distance is outvoted.

    Examples
    --------
    >>> import asterism as am
    >>> bonds = am.learn_bonds(am.simulate.fingers(frames=40, seed=1))
    >>> later = am.simulate.fingers(frames=40, seed=2).detections
    >>> naming = am.name_tracks(am.track(later, am.GNN()), bonds)
    >>> naming
    Naming(23 of 23 tracks)
    >>> naming.tracks.names[:3]
    ('T1', 'T2', 'T3')
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("bonds", bonds, Bonds, "am.learn_bonds(tracks)")
    if tracks.detections.n_axes != bonds.places.shape[1]:
        expected = f"{bonds.places.shape[1]} axes, as the bonds have"
        raise ParameterError("tracks", expected, tracks.detections.n_axes)
    long = _LongTracks.of(tracks)
    named, probabilities = _search(long, _Known.of(bonds))
    _name_pieces(long, _Known.of(bonds), named, probabilities)
    markers = np.full(tracks.n_tracks, -1, dtype=np.int64)
    sure = np.zeros(tracks.n_tracks)
    markers[long.tracks], sure[long.tracks] = named, probabilities
    return Naming(tracks=_renamed(tracks, markers, bonds), markers=markers, probabilities=sure)


@dataclass(frozen=True, eq=False, kw_only=True)
class _LongTracks:
    """The n tracks that are long enough, with their mutual distances."""

    tracks: NDArray[np.int64]
    positions: NDArray[np.float64]  # (F, n, D)
    middle: NDArray[np.float64]  # (n, n), NaN for two with too few common frames
    spread: NDArray[np.float64]
    variance: NDArray[np.float64]  # predictive; infinite for these
    seen: NDArray[np.bool_]  # (T, n)

    @classmethod
    def of(cls, tracks: Tracks) -> _LongTracks:
        d = tracks.detections
        every = max(1, -(-d.n_frames // MAX_FRAMES))
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
        """Return the order of naming: each track by its distances to earlier ones."""
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

    def steadiest(self, k: int, others: list[int]) -> list[int]:
        """Return those of `others` with the most stable distances to a track."""
        known = [b for b in others if np.isfinite(self.middle[k, b])]
        return [known[b] for b in np.argsort(self.variance[k, known], kind="stable")[:LOOKED_AT]]

    def height(self, k: int, three: list[int]) -> tuple[float, float]:
        """Return median and spread of a track's height over the plane of three others."""
        a, b, c = (self.positions[:, i] for i in three)
        values = _height(self.positions[:, k], a, b, c)
        values = np.sort(values[np.isfinite(values)])
        if len(values) < 3:
            return np.nan, np.nan
        low, middle, high = values[(np.array([0.16, 0.5, 0.84]) * len(values)).astype(int)]
        return float(middle), float(high - low) / 2


@dataclass(frozen=True, eq=False, kw_only=True)
class _Known:
    """Bonds as tables over K markers; pairs without a bond have their distance in the pose."""

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
        """Return the log odds that two tracks are each pair of markers, (K, K)."""
        varied = spread**2 + self.spread**2
        log_odds = np.nan_to_num(_log_odds(middle - self.distance, varied, self.distance))
        return np.where(self.is_bond, log_odds, log_odds.clip(*UNBONDED))


def _log_odds(
    off: NDArray[np.float64], varied: NDArray[np.float64], size: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Return bounded log odds of Student's t with three degrees of freedom against uniform."""
    scale2 = np.stack([varied + (fixed + share * size) ** 2 for fixed, share in (LEFT, REPLACED)])
    log_t = -2 * np.log1p(off**2 / scale2 / 3) - 0.5 * np.log(scale2) - 1.0  # log t(0) = -1.0
    log_odds = log_t.max(axis=0) + np.log(ANYWHERE)
    return np.clip(log_odds, MIN_LOG_ODDS, MAX_LOG_ODDS)


def _height(
    x: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the signed height of x over the plane through a, b and c, right-handed."""
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return ((x - a) * normal).sum(axis=-1) / length


def _search(long: _LongTracks, known: _Known) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Name the tracks by the best assignment, with each name's probability in the final beam."""
    n, K = len(long.tracks), len(known.places)
    named = np.full((1, n), -1, dtype=np.int64)
    is_used = np.zeros((1, K), dtype=bool)
    score = np.zeros(1)
    done: list[int] = []
    for k in long.order():
        others = long.steadiest(k, done)
        more = _evidence(long, known, k, others, named)
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
    weights = np.exp(WEIGHT * (score - score.max()))
    weights /= weights.sum()
    best_way = named[int(np.argmax(score))]
    probabilities = ((named == best_way) * weights[:, None]).sum(axis=0)
    return best_way.copy(), np.where(best_way >= 0, probabilities, 0)


def _evidence(
    long: _LongTracks, known: _Known, k: int, others: list[int], named: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the log odds of each marker for a track, for each assignment, (assignments, K)."""
    ways, K = len(named), len(known.places)
    out = np.zeros((ways, K))
    for b in others:
        table = known.log_odds(float(long.middle[k, b]), float(long.spread[k, b]))
        has = named[:, b] >= 0
        out[has] += table[:, named[has, b]].T
    if known.places.shape[1] == 3 and len(others) >= 3:
        out += _sides(long, known, k, others, named)
    return out


def _sides(
    long: _LongTracks, known: _Known, k: int, others: list[int], named: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return log odds from the side of three others on which a track lies."""
    out = np.zeros((len(named), len(known.places)))
    for three in ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]):
        if max(three) >= len(others):
            continue
        chosen = [others[i] for i in three]
        height, spread = long.height(k, chosen)
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
    long: _LongTracks,
    known: _Known,
    named: NDArray[np.int64],
    probabilities: NDArray[np.float64],
) -> None:
    """Name remaining tracks that are pieces of named ones, in place."""
    counts = long.seen.sum(axis=0)
    for k in sorted(np.flatnonzero(named < 0), key=lambda k: -counts[k]):
        has = np.flatnonzero(named >= 0)
        others = long.steadiest(int(k), has.tolist())
        if not others:
            continue
        log_odds = _evidence(long, known, int(k), others, named[None])[0]
        # Tracks with a common frame are different markers.
        at_once = (long.seen[:, has] & long.seen[:, [k]]).any(axis=0)
        log_odds[named[has[at_once]]] = -np.inf
        best = int(np.argmax(log_odds))
        if log_odds[best] < ENOUGH:
            continue
        weights = np.exp(WEIGHT * (log_odds - log_odds[best]))
        named[k], probabilities[k] = (
            best,
            1 / (weights.sum() + np.exp(-WEIGHT * log_odds[best])),
        )


def _renamed(tracks: Tracks, markers: NDArray[np.int64], bonds: Bonds) -> Tracks:
    """Merge the tracks of each marker and name them."""
    into = np.arange(tracks.n_tracks)
    for marker in np.unique(markers[markers >= 0]):
        same = np.flatnonzero(markers == marker)
        into[same] = same[0]
    kept, into = np.unique(into, return_inverse=True)
    labels = np.where(tracks.labels >= 0, into[tracks.labels], -1)
    names = [bonds.names[markers[k]] if markers[k] >= 0 else None for k in kept]
    return replace(tracks, labels=labels, names=tuple(names))
