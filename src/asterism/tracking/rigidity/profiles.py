"""Distances that tracks keep, learnt from frames spread through the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.records import record
from asterism.tracking.rigidity.sampled import sampled_frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["Profiles", "candidate_margins", "learn_profiles"]

SAMPLES = 160
"""Number of frames from which profiles are learnt."""
UNLIKE = -2.0
"""Log density relative to an unknown marker below which other tracks are not compared."""


@record(eq=False)
class Profiles:
    """Medians and spreads of the distances of tracks to the longest tracks.

    Parameters
    ----------
    frames : ndarray of int
        Frames whose detections the profiles hold, rising.
    engine : DistanceProfiles
        Profiles of the detections of these frames.
    """

    frames: NDArray[np.int64]
    engine: _engine.DistanceProfiles


def learn_profiles(
    detections: Detections,
    labels: NDArray[np.int64],
    noise_sigma: float,
    also: NDArray[np.int64] | None = None,
) -> Profiles:
    """Learn the distances of all tracks from frames spread through the capture.

    Only these frames are copied, so that a capture of any length takes little memory.

    Parameters
    ----------
    detections : Detections
        Detections of a capture.
    labels : ndarray of int, shape (N,)
        Track of each detection.
    noise_sigma : float
        Standard deviation of a coordinate, metres.
    also : ndarray of int, optional
        Frames with parts of tracks that will be compared with the profiles.
    """
    d = detections
    samples = sampled_frames(d.n_frames, SAMPLES)
    frames = samples if also is None else np.union1d(samples, also)
    rows, offsets = _rows(d, frames)
    engine = _engine.DistanceProfiles(
        np.ascontiguousarray(d.points[rows]), labels[rows], offsets,
        np.searchsorted(frames, samples).astype(np.int64),
        n_tracks=int(labels.max(initial=-1)) + 1, noise=noise_sigma,
    )  # fmt: skip
    return Profiles(frames=frames, engine=engine)


def candidate_margins(
    detections: Detections,
    labels: NDArray[np.int64],
    noise_sigma: float,
    candidates: NDArray[np.int64],
    track: int,
) -> NDArray[np.float64]:
    """Return how well the distances of single detections fit a track, shape (n, 2).

    Parameters
    ----------
    detections, labels, noise_sigma
        As for `learn_profiles`.
    candidates : ndarray of int, shape (n,)
        Detections in frames in which the track has none.
    track : int
        The track.

    Returns
    -------
    ndarray of shape (n, 2)
        Log densities relative to an unknown marker, and to the best other track without a detection
        in the frame. The second is infinite without such a track, and minus infinite where the
        first is below `UNLIKE`. Both are 0 for a track that keeps no distances.
    """
    d = detections
    samples = sampled_frames(d.n_frames, SAMPLES)
    # Each candidate has a copy of its frame.
    frame = d.frame_of[candidates]
    rows, offsets = _rows(d, np.concatenate([samples, frame]))
    own, first = labels[rows], offsets[len(samples) : -1]
    own[first + candidates - d.offsets[frame]] = track
    n, n_tracks = len(candidates), int(labels.max(initial=track)) + 1
    engine = _engine.DistanceProfiles(
        np.ascontiguousarray(d.points[rows]), own, offsets, np.arange(len(samples)),
        n_tracks=n_tracks, noise=noise_sigma,
    )  # fmt: skip
    at, none = len(samples) + np.arange(n), np.empty(0, dtype=np.int64)
    unknown = engine.densities(np.full(n, track), at, np.arange(n + 1), none)[:, 0]
    found = np.stack([-unknown, np.where(unknown == 0, 0.0, -np.inf)], axis=1)
    alike = np.flatnonzero((found[:, 0] > UNLIKE) & (unknown != 0))
    is_there = np.zeros((len(alike), n_tracks + 1), dtype=bool)
    counts = d.counts[frame[alike]]
    rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    there = own[np.repeat(first[alike], counts) + rank]
    is_there[np.repeat(np.arange(len(alike)), counts), there] = True
    others = np.flatnonzero(~is_there[:, :-1].all(axis=0))
    densities = engine.densities(
        np.full(len(alike), track), at[alike], np.arange(len(alike) + 1), others
    )[:, :-1]
    densities[is_there[:, others] | (densities == 0)] = -np.inf
    found[alike, 1] = -densities.max(axis=1, initial=-np.inf)
    return found


def _rows(d: Detections, frames: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the detections of frames, and where each frame begins among them."""
    counts = d.counts[frames]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return np.repeat(d.offsets[frames] - offsets[:-1], counts) + np.arange(offsets[-1]), offsets
