"""Tracks in slow motion before their capture, in which a tracker learns the bonds beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, Tracks

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["after_slow_start", "with_slow_start"]

SLOWER = 4
"""Factor by which the motion is slower than in the capture."""
MAX_FRAMES = 500
"""Largest number of frames of the capture that are shown in slow motion, the first ones."""


def with_slow_start(tracks: Tracks) -> Detections:
    """Return the capture of tracks, preceded by the tracks in slow motion.

    They are shown backwards until the first frame, in which the capture continues them. A marker
    moves little between two frames there, so that a tracker confirms it and learns its bonds.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the capture.

    Returns
    -------
    Detections
        `SLOWER` frames for each step of the first `MAX_FRAMES` frames, and then the capture.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> truth.detections.n_frames, with_slow_start(truth).n_frames
    (40, 196)
    """
    d, labels = tracks.detections, tracks.labels
    frames = [
        np.flatnonzero(labels[begin:end] >= 0) + begin
        for begin, end in zip(d.offsets[:MAX_FRAMES], d.offsets[1 : MAX_FRAMES + 1], strict=False)
    ]
    pairs: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for before, after in zip(frames[-2::-1], frames[:0:-1], strict=True):
        _, i, j = np.intersect1d(labels[before], labels[after], return_indices=True)
        pairs.append((before[i], after[j]))
    steps = np.arange(SLOWER) / SLOWER

    def mixed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values of the points between those of each pair, and then of the capture."""
        between = [
            (1 - step) * values[after] + step * values[before]
            for before, after in pairs
            for step in steps
        ]
        return np.concatenate([*between, values])

    counts = np.concatenate([np.repeat([len(i) for i, _ in pairs], SLOWER), d.counts])
    n_slow = len(counts) - d.n_frames
    times = d.times[:1] - (d.step or 1.0) * np.arange(n_slow, 0, -1)
    return Detections(
        times=np.concatenate([times, d.times]),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        points=mixed(d.points),
        covariances=None if d.covariances is None else mixed(d.covariances),
    )


def after_slow_start(tracks: Tracks, detections: Detections) -> Tracks:
    """Return the part of tracks that belongs to the capture.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture with a slow start.
    detections : Detections
        The capture.

    Returns
    -------
    Tracks
        Tracks in the same order, without those of the slow start alone.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> tracks = am.track(with_slow_start(truth), am.GNN())
    >>> tracks.detections.n_frames, after_slow_start(tracks, truth.detections).detections.n_frames
    (196, 40)
    """
    own = slice(-detections.n_points, None)
    labels = tracks.labels[own].copy()
    is_track = labels >= 0
    labels[is_track] = np.unique(labels[is_track], return_inverse=True)[1]
    return Tracks(
        detections=detections,
        labels=labels,
        confidence=None if tracks.confidence is None else tracks.confidence[own],
        info=tracks.info,
        recipe=tracks.recipe,
    )
