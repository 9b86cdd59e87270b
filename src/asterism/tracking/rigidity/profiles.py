"""Distances that tracks keep, learnt from frames spread through the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["Profiles", "learn_profiles"]

SAMPLES = 160
"""Number of frames from which profiles are learnt."""


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
    n = min(SAMPLES, d.n_frames)
    samples = np.arange(n) * d.n_frames // max(n, 1)
    frames = samples if also is None else np.union1d(samples, also)
    counts = d.counts[frames]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rows = np.repeat(d.offsets[frames] - offsets[:-1], counts) + np.arange(offsets[-1])
    return Profiles(
        frames=frames,
        engine=_engine.DistanceProfiles(
            np.ascontiguousarray(d.points[rows]),
            labels[rows],
            offsets,
            np.searchsorted(frames, samples).astype(np.int64),
            n_tracks=int(labels.max(initial=-1)) + 1,
            noise=noise_sigma,
        ),
    )
