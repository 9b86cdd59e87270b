"""Parts of tracks between uncertain links."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record
from asterism.tracking.rigidity.profiles import learn_profiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Evidence", "Parts", "compare", "part_tracks"]

PART_FRAMES = 8
"""Number of frames of a part in which distances are measured."""


@record(eq=False)
class Parts:
    """Parts of tracks, in the order of `Tracks.by_track`.

    Parameters
    ----------
    track : ndarray of int, shape (P,)
        Track of each part.
    offsets : ndarray of int, shape (P + 1,)
        Part ``p`` holds ``order[offsets[p]:offsets[p + 1]]``, with the order of `Tracks.by_track`.
    before : ndarray of shape (P,)
        Probability of the link that leads to each part, 1 for the first part of a track.
    """

    track: NDArray[np.int64]
    offsets: NDArray[np.int64]
    before: NDArray[np.float64]

    @property
    def n_detections(self) -> NDArray[np.int64]:
        """Number of detections of each part, shape (P,)."""
        return np.diff(self.offsets)

    @property
    def weakest(self) -> NDArray[np.float64]:
        """Probability of the less certain link at the ends of each part, shape (P,)."""
        return np.minimum(self.before, self.after)

    def is_whole(self, n_tracks: int) -> NDArray[np.bool_]:
        """Return whether each part is a whole track, shape (P,)."""
        return np.bincount(self.track, minlength=n_tracks)[self.track] == 1

    @property
    def after(self) -> NDArray[np.float64]:
        """Probability of the link that leaves each part, 1 for the last part of a track."""
        return np.append(self.before, 1.0)[1:]


@record(eq=False, kw_only=False)
class Evidence:
    """Comparison of parts with the distances that tracks keep.

    Parameters
    ----------
    is_known : ndarray of bool, shape (P,)
        Whether a part has enough steady distances; False for whole tracks, which are not compared.
    unknown : ndarray of shape (P,)
        Log density of an unknown marker relative to the own track.
    in_range : ndarray of shape (P,)
        The same by the range of most deviations from the distances of the own track, which posture
        changes less.
    alternatives : ndarray of int, shape (P, 3)
        Other tracks whose distances fit best, -1 for none.
    densities : ndarray of shape (P, 3)
        Their log densities relative to the own track, falling; -inf for none.
    """

    is_known: NDArray[np.bool_]
    unknown: NDArray[np.float64]
    in_range: NDArray[np.float64]
    alternatives: NDArray[np.int64]
    densities: NDArray[np.float64]


def part_tracks(
    tracks: Tracks, cuts: NDArray[np.int64], probabilities: NDArray[np.float64]
) -> Parts:
    """Cut tracks at uncertain links.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    cuts : ndarray of int, shape (n,)
        Detections before which a track is cut, rising.
    probabilities : ndarray of shape (n,)
        Probability of the link that leads to each.
    """
    order, offsets = tracks.by_track
    is_start = np.zeros(len(tracks.labels), dtype=bool)
    is_start[cuts] = True
    is_start = is_start[order]
    firsts = offsets[:-1][np.diff(offsets) > 0]
    is_start[firsts] = True
    starts = np.flatnonzero(is_start)
    at = np.searchsorted(cuts, order[starts])
    has = at < len(cuts)
    has[has] = cuts[at[has]] == order[starts[has]]
    before = np.ones(len(starts))
    before[has] = probabilities[at[has]]
    before[np.searchsorted(starts, firsts)] = 1.0
    return Parts(
        track=tracks.labels[order[starts]],
        offsets=np.append(starts, len(order)).astype(np.int64),
        before=before,
    )


def compare(
    tracks: Tracks,
    parts: Parts,
    partners: NDArray[np.int64],
    noise_sigma: float,
    *,
    threads: int = 1,
) -> Evidence:
    """Compare the distances of parts to other tracks with those that tracks keep.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    parts : Parts
        Parts of the tracks.
    partners : ndarray of int, shape (P, 2)
        Tracks that may have exchanged a part with the own track at its start and at its end, -1
        for none.
    noise_sigma : float
        Standard deviation of a coordinate, metres.
    threads : int
        Number of threads; it has no influence on the result.
    """
    frame = tracks.detections.frame_of
    order, _ = tracks.by_track
    n = len(parts.track)
    evidence = Evidence(
        np.zeros(n, bool), np.zeros(n), np.zeros(n), np.full((n, 3), -1), np.full((n, 3), -np.inf)
    )
    used = np.flatnonzero(~parts.is_whole(tracks.n_tracks))
    if len(used):
        begins, lengths = parts.offsets[used], parts.n_detections[used]
        counts = np.minimum(lengths, PART_FRAMES)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        rank = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
        spacing = (lengths - 1) / np.maximum(counts - 1, 1)
        chosen = np.repeat(begins, counts) + (rank * np.repeat(spacing, counts)).astype(np.int64)
        frames = frame[order[chosen]].astype(np.int64)
        profiles = learn_profiles(tracks.detections, tracks.labels, noise_sigma, frames)
        found = profiles.engine.compare(
            parts.track[used],
            np.searchsorted(profiles.frames, frames).astype(np.int64),
            offsets,
            np.ascontiguousarray(partners[used]),
            n_threads=threads,
        )
        arrays = (
            evidence.is_known, evidence.unknown, evidence.in_range, evidence.alternatives,
            evidence.densities,
        )  # fmt: skip
        for values, own in zip(arrays, found, strict=True):
            values[used] = own
    return evidence
