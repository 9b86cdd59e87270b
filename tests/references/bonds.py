"""Slow words for what distance bonds say of a partition."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import asterism as am


@dataclass
class Bonds:
    """Bonds of markers, and the detection that each marker is known for."""

    pairs: list[tuple[int, int]]
    lengths: list[tuple[float, float]]  # (μ, s) of each
    weight: float
    known: list[int]  # by detection: marker, -1 for none
    frozen: int = -1  # frames up to this one are settled
    few: int = field(default=3, repr=False)

    def give_to(self, chain) -> None:
        chain.bond(
            np.array(self.pairs, dtype=np.int64).reshape(-1, 2),
            np.array(self.lengths, dtype=float).reshape(-1, 2),
            self.weight,
            np.array(self.known, dtype=np.int64),
        )

    def marker(self, track) -> int:
        """Give the marker that a track is: that of the first detection which is known."""
        return next((self.known[i] for i in track if self.known[i] >= 0), -1)

    def says(self, k: int, distance: float) -> float:
        """Give what one bond says of a distance."""
        n = max(self.few, *(sum(m in pair for pair in self.pairs) for m in self.pairs[k]))
        mean, scale = self.lengths[k]
        z = (distance - mean) / scale
        return self.weight / n * (1 - z * z) / (1 + z * z)

    def total(self, d: am.Detections, partition) -> float:
        """Give B(ω)."""
        at = {
            (self.marker(track), d.frame_of[i]): d.points[i]
            for track in partition
            for i in track
            if d.frame_of[i] > self.frozen
        }
        return sum(
            self.says(k, float(np.linalg.norm(at[a, t] - at[c, t])))
            for t in range(d.n_frames)
            for k, (a, c) in enumerate(self.pairs)
            if (a, t) in at and (c, t) in at
        )


def some_bonds(
    d: am.Detections, seed: int, *, settled: int | None = None, weight: float = 10.0,
    most: int = 4, of: type[Bonds] = Bonds,
) -> Bonds:  # fmt: skip
    """Give bonds of a few detections, all with each other.

    Those of the settled frame, of which each is a marker; otherwise of any frame.
    """
    rng = np.random.default_rng(seed)
    own = np.arange(d.n_points) if settled is None else np.flatnonzero(d.frame_of == settled)
    own = rng.permutation(own)[:most]
    known = np.full(d.n_points, -1)
    known[own] = np.arange(len(own))
    pairs = list(itertools.combinations(range(len(own)), 2))
    lengths = [
        (float(np.linalg.norm(d.points[own[a]] - d.points[own[c]])), float(rng.uniform(0.02, 0.05)))
        for a, c in pairs
    ]
    return of(pairs, lengths, weight, known.tolist(), -1 if settled is None else settled)
