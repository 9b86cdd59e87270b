"""Segments whose markers are lost together: found in a frame by all their distances at once.

Where all markers of a segment have no detection on their tracks, no distance to a known marker
tells one of them. The distances among them do: several detections that keep them all are hardly
ever clutter.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.reassign import PROBABLE
from asterism.tracking.estimation.evidence import Region
from asterism.tracking.rigidity import learn_bonds
from asterism.tracking.rigidity.distances import Distances

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["with_lost_segments"]

MIN_LOST, MIN_PLACED = 2, 3
"""Smallest number of markers of a segment that are lost in a frame, and that are there after it."""
MAX_DEVIATION = 3.0
"""Largest deviation of a distance, in standard deviations."""
MAX_SETS = 10_000
"""Largest number of sets of detections that are compared in a frame. There are more if more than 13
markers are lost, or if most distances are alike; the segment is then left as it is."""

_Node = tuple[int, int]
"""Marker of a segment, and detection."""


def with_lost_segments(
    tracks: Tracks, is_open: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Assign open detections to the tracks of segments of which at least two are lost in a frame.

    The assignment of a segment in a frame has the largest sum of log-likelihood ratios of all its
    distances, a Gaussian over clutter in the volume of the capture, less the log odds of each
    detection being of any other marker or clutter. It holds if it leads by log 20 over every other
    one that contradicts it, so that equilateral triangles are left as they are.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    is_open : ndarray of bool, shape (N,)
        Detections that may go to another track.

    Returns
    -------
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    is_placed : ndarray of bool, shape (N,)
        Detections of such segments.
    """
    d, labels = tracks.detections, tracks.labels.astype(np.int64)
    bonds = learn_bonds(replace(tracks, names=(None,) * tracks.n_tracks))
    of = Distances(middle=bonds.distances, spread=bonds.spreads, n_frames=bonds.frames)
    middle = np.zeros((2, tracks.n_tracks, tracks.n_tracks))
    for i, j in (bonds.pairs.T, bonds.pairs.T[::-1]):
        middle[:, i, j] = of.middle, np.sqrt(of.predictive_variance)
    is_placed = np.zeros(len(labels), dtype=bool)
    log_volume = float(np.log(Region.of(d).volume))
    held = np.full((d.n_frames, tracks.n_tracks), -1)
    held[d.frame_of[labels >= 0], labels[labels >= 0]] = np.flatnonzero(labels >= 0)
    is_lost = (held < 0) | is_open[held]
    for segment in bonds.clusters:
        own = np.array(segment)
        distances, sigma = middle[:, own[:, None], own]
        for t in np.flatnonzero(is_lost[:, own].sum(axis=1) >= MIN_LOST):
            free = np.arange(d.offsets[t], d.offsets[t + 1])
            free = free[is_open[free]]
            known = np.flatnonzero(~is_lost[t, own])
            if len(free) < MIN_LOST or len(free) + len(known) < MIN_PLACED:
                continue
            rows = np.concatenate([held[t, own[known]], free])
            nodes = [(int(k), i) for i, k in enumerate(known)]
            nodes += [
                (int(k), i)
                for k in np.flatnonzero(is_lost[t, own])
                for i in range(len(known), len(rows))
            ]
            found = _placed(d.points[rows], nodes, len(known), distances, sigma, log_volume)
            for k, _ in found:
                before = held[t, own[k]]
                if before >= 0 and labels[before] == own[k]:
                    labels[before] = -1
            for k, i in found:
                labels[rows[i]], is_placed[rows[i]] = own[k], True
    return labels, is_placed


def _placed(
    points: NDArray[np.float64],
    nodes: Sequence[_Node],
    n_known: int,
    distances: NDArray[np.float64],
    sigma: NDArray[np.float64],
    log_volume: float,
) -> list[_Node]:
    """Return the detections of the lost markers of a segment in a frame.

    Parameters
    ----------
    points : ndarray of shape (n, D)
        Detections; the known ones come first.
    nodes : sequence of (int, int)
        Markers and detections that may belong together; the known ones come first.
    n_known : int
        Number of known ones.
    distances, sigma : ndarray of shape (K, K)
        Distances that the markers keep, and their standard deviations, metres.
    log_volume : float
        Logarithm of the volume of the capture, cubic metres.
    """
    k, i = np.array(nodes).T
    apart = np.linalg.norm(points[i, None] - points[i], axis=2)
    usual, s = distances[k[:, None], k], np.maximum(sigma[k[:, None], k], 1e-9)
    off = (apart - usual) / s
    fits = (k[:, None] != k) & (i[:, None] != i) & (np.abs(off) <= MAX_DEVIATION)
    fits[:n_known, :n_known] = True
    ratio = log_volume - off**2 / 2 - np.log(s) - np.log(4 * np.pi * np.maximum(usual, 1e-9) ** 2)
    ratio -= np.log(2 * np.pi) / 2
    price = PROBABLE + np.log(len(points) - n_known)
    is_used = fits[:, :n_known].all(axis=1)
    while True:  # a marker without two others beside it is not among three
        enough = (fits[:, is_used].sum(axis=1) >= MIN_PLACED - 1) & is_used
        enough[:n_known] = True
        if (enough == is_used).all():
            break
        is_used = enough
    used = np.flatnonzero(is_used[n_known:]) + n_known
    if not len(used):
        return []
    alone = ratio[:, :n_known].sum(axis=1) - price
    found = list(itertools.islice(_cliques(used.tolist(), fits, ratio, alone), MAX_SETS + 1))
    if len(found) > MAX_SETS:
        return []
    found = [one for one in found if len(one[1]) + n_known >= MIN_PLACED]
    found.sort(key=lambda one: -one[0])
    if not found or found[0][0] <= 0:
        return []
    best_score, best = found[0]
    chosen = {nodes[n] for n in best}
    markers, taken = {one[0] for one in chosen}, {one[1] for one in chosen}
    for score, clique in found[1:]:
        if score < best_score - PROBABLE:
            break
        others = {nodes[n] for n in clique} - chosen
        if any(one[0] in markers or one[1] in taken for one in others):
            return []
    return sorted(chosen)


def _cliques(
    nodes: Sequence[int],
    fits: NDArray[np.bool_],
    ratio: NDArray[np.float64],
    alone: NDArray[np.float64],
) -> Iterator[tuple[float, list[int]]]:
    """Yield the sets of nodes that all fit each other, with their scores."""
    stack: list[tuple[float, list[int], list[int]]] = [(0.0, [], list(nodes))]
    while stack:
        score, clique, left = stack.pop()
        if clique:
            yield score, clique
        for n, one in enumerate(left):
            gain = alone[one] + ratio[one, clique].sum()
            stack.append((score + gain, [*clique, one], [i for i in left[n + 1 :] if fits[one, i]]))
