"""Bonds: pairs of markers with a stable distance, estimated from a capture."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind, check_number, keep_array
from asterism.errors import ParameterError
from asterism.io.captures.marker_names import is_unlabelled
from asterism.model import Tracks
from asterism.records import record
from asterism.tracking.rigidity.cliques import disjoint_cliques
from asterism.tracking.rigidity.distances import (
    BEND,
    MIN_TOGETHER,
    Distances,
    distances_between,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Bonds", "learn_bonds"]

MAX_FRAMES = 1000
"""Number of evenly spread frames of a capture in which distances are measured."""
LOOSE = 2.5
"""Largest spread of a rigid pair, as a multiple of that of the steadiest pairs of the capture. The
share `BEND` of its distance is the other bound. Other bonds may vary more than a segment does."""


@record(eq=False)
class Bonds:
    """Pairs of markers with a stable distance (bonds).

    Parameters
    ----------
    names : tuple of str
        Names of the K markers, all different.
    pairs : array_like of int, shape (M, 2)
        Bonded markers, the lower index first.
    distances : array_like of shape (M,)
        Median distance of each pair, metres.
    spreads : array_like of shape (M,)
        Standard deviation of each distance, metres.
    frames : array_like of int, shape (M,)
        Number of frames from which each distance was measured.

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    Examples
    --------
    >>> import asterism as am
    >>> bonds = am.tracking.learn_bonds(am.simulate.person(frames=60, seed=1))
    >>> bonds
    Bonds(53 markers, 412 pairs, 206 rigid, 10 clusters)
    >>> trunk = bonds.clusters[0]  # the largest rigid cluster
    >>> [bonds.names[k] for k in trunk]
    ['RFHD', 'RBHD', 'C7', 'T10', 'CLAV', 'STRN', 'RBAK', 'LSHO', 'ARIEL']
    >>> int(bonds.steady.sum()), int(bonds.rigid.sum())
    (409, 206)
    """

    names: tuple[str, ...]
    pairs: NDArray[np.int64]
    distances: NDArray[np.float64]
    spreads: NDArray[np.float64]
    frames: NDArray[np.int64]

    def __post_init__(self) -> None:
        names = tuple(self.names)
        if len(set(names)) < len(names) or not all(names):
            got = next((name for i, name in enumerate(names) if name in ("", *names[:i])), "")
            raise ParameterError("names", "names that are all different", repr(got))
        pairs = keep_array("pairs", self.pairs, ("M", 2), dtype=np.int64)
        M = len(pairs)
        if M and (pairs.min() < 0 or pairs.max() >= len(names)):
            raise ParameterError("pairs", f"markers from 0 to {len(names) - 1}", pairs.max())
        first = np.unique(pairs, axis=0, return_index=True)[1]
        wrong = np.append(np.flatnonzero(pairs[:, 0] >= pairs[:, 1]), np.setdiff1d(range(M), first))
        if len(wrong):
            expected = "two different markers, the lower first, once"
            raise ParameterError("pairs", expected, tuple(pairs[wrong[0]].tolist()))
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "pairs", pairs)
        for name, kind in (
            ("distances", np.float64),
            ("spreads", np.float64),
            ("frames", np.int64),
        ):
            array = keep_array(name, getattr(self, name), (M,), dtype=kind)
            if M and array.min() < 0:
                raise ParameterError(name, "numbers ≥ 0", array.min())
            object.__setattr__(self, name, array)

    @cached_property
    def steady(self) -> NDArray[np.bool_]:
        """True for pairs that are bonds by the engine's criterion, shape (M,)."""
        return Distances(middle=self.distances, spread=self.spreads, n_frames=self.frames).is_bond

    @cached_property
    def rigid(self) -> NDArray[np.bool_]:
        """True for pairs that are as rigid as the steadiest pairs of the capture, shape (M,)."""
        if not len(self.pairs):
            return np.zeros(0, dtype=bool)
        steadiest = np.full(len(self.names), np.inf)
        for side in self.pairs.T:
            np.minimum.at(steadiest, side, self.spreads)
        usual = float(np.quantile(steadiest[np.isfinite(steadiest)], 0.25))
        return self.spreads <= LOOSE * usual + BEND * self.distances

    @cached_property
    def clusters(self) -> tuple[tuple[int, ...], ...]:
        """Rigid clusters: disjoint groups of at least three markers with rigid pairs only."""
        return disjoint_cliques(len(self.names), self.pairs[self.rigid])

    def segments(self, names: Sequence[str | None]) -> NDArray[np.int64]:
        """Return the rigid cluster of each marker name, -1 for a name in none.

        Parameters
        ----------
        names : sequence of (str or None), length K
            For example `Tracks.names`.

        Returns
        -------
        ndarray of int, shape (K,)
            Indices in `clusters`.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.person(seed=1)
        >>> am.tracking.learn_bonds(truth).segments(["LFHD", "RFHD", "LKNE", None]).tolist()
        [0, 0, 5, -1]
        """
        of = {self.names[k]: s for s, cluster in enumerate(self.clusters) for k in cluster}
        return np.array([of.get(name or "", -1) for name in names], dtype=np.int64)

    def __repr__(self) -> str:
        return (
            f"Bonds({len(self.names)} markers, {len(self.pairs)} pairs, {int(self.rigid.sum())} "
            f"rigid, {len(self.clusters)} clusters)"
        )


def learn_bonds(tracks: Tracks, *, neighbours: int = 12, min_frames: int = MIN_TOGETHER) -> Bonds:
    """Learn the bonds of a capture: the pairs of markers with stable distances.

    For each marker the `neighbours` steadiest pairs are kept: those whose distance has the
    smallest predictive variance.

    Parameters
    ----------
    tracks : Tracks
        Tracks with the names of the markers. Tracks without a name, or with a placeholder of a
        capture software (``*12``, ``Unlabeled 7``), are left out. If no track has a name, all
        are used under the names ``T000``, ``T001`` … by their number.
    neighbours : int
        Smallest number of pairs of each marker, if there are that many, 1 to 1000. The default of
        12 is several times the number of markers on a segment. Larger values add pairs of
        different segments, which identify a marker less.
    min_frames : int
        Smallest number of frames in which both markers of a pair are detected, ≥ 2. With fewer
        frames a distance can be stable by chance.

    Returns
    -------
    Bonds
        Pairs with their distances.

    Raises
    ------
    ParameterError
        If an option is out of range, or two tracks have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> bonds = am.tracking.learn_bonds(am.simulate.cube(frames=40, seed=1))
    >>> bonds
    Bonds(8 markers, 28 pairs, 28 rigid, 1 clusters)
    >>> bonds.pairs[0].tolist(), round(float(bonds.distances[0]), 3)
    ([0, 1], 0.3)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_number("neighbours", neighbours, above=1, below=1000, closed=True, integer=True)
    check_number("min_frames", min_frames, above=2, below=1e6, closed=True, integer=True)
    tracks = tracks.measured()
    d = tracks.detections
    every = max(1, -(-d.n_frames // MAX_FRAMES))
    named = [k for k, name in enumerate(tracks.names) if name and not is_unlabelled(name)]
    names = [str(tracks.names[k]) for k in named]
    if not named:
        named, names = list(range(tracks.n_tracks)), [f"T{k:03d}" for k in range(tracks.n_tracks)]
    positions = tracks.positions()[::every, named]
    between = distances_between(positions)
    K = len(named)
    cost = between.predictive_variance
    cost[(between.n_frames * every < min_frames) | np.eye(K, dtype=bool)] = np.inf
    order = np.argsort(cost, axis=1, kind="stable")[:, :neighbours]
    chosen = np.zeros((K, K), dtype=bool)
    np.put_along_axis(chosen, order, values=True, axis=1)
    chosen = (chosen | chosen.T) & np.isfinite(cost)
    i, j = np.nonzero(np.triu(chosen))
    return Bonds(
        names=tuple(names),
        pairs=np.stack([i, j], axis=1),
        distances=between.middle[i, j],
        spreads=between.spread[i, j],
        frames=between.n_frames[i, j] * every,
    )
