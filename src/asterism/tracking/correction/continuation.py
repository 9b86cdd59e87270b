"""Detections without a track that continue one of them along a track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections
    from asterism.tracking.correction.evidence import Evidence
    from asterism.tracking.correction.exchange import Motion

__all__ = ["continuation"]

IDLE = 50
"""Frames along a track after which no more detections without a track are looked for."""
MIN_FIT = -40.0
"""Smallest log likelihood, relative to straight motion, of a detection that continues another. It
is far below that of a link of the tracker, which misses markers that accelerate."""


def continuation(
    detections: Detections,
    detection: int,
    target: int,
    labels: NDArray[np.int64],
    free: NDArray[np.bool_],
    evidence: Evidence,
    motion: Motion,
) -> list[int]:
    """Return the detections without a track that continue one of them to a track.

    They fit by motion or, where the track has none, by its distances to other tracks.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    detection : int
        Detection without a track.
    target : int
        Track to which it will belong.
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    free : ndarray of bool, shape (N,)
        Detections without a track that may be taken.
    evidence : Evidence
        Distances that the tracks keep.
    motion : Motion
        Motion of the model.

    Returns
    -------
    list of int
        The detection and those that continue it.
    """
    d, frame = detections, detections.frame_of
    is_known = np.zeros(d.n_frames, dtype=bool)
    is_known[frame[labels == target]] = True
    t = int(frame[detection])
    near = slice(d.offsets[max(t - IDLE, 0)], d.offsets[min(t + IDLE + 1, d.n_frames)])
    own = np.arange(near.start, near.stop)[free[near] & ~is_known[frame[near]]]
    odds = np.zeros(len(labels))
    odds[own] = evidence.log_odds(own, labels, target)
    found = [detection]
    for way in (1, -1):
        before, head, newest = -1, detection, int(frame[detection])
        t = newest + way
        while (
            0 <= t < d.n_frames
            and abs(t - int(frame[head])) <= motion.max_gap
            and abs(t - newest) <= IDLE
        ):
            own = np.arange(d.offsets[t], d.offsets[t + 1])
            own = own[free[own] | (labels[own] == target)]
            if len(own):
                fits = motion.continuation(before, head, own)
                fits = np.maximum(fits, MIN_FIT) + odds[own]
                best = int(np.argmax(fits))
                if fits[best] > MIN_FIT:
                    before, head = head, int(own[best])
                    if labels[head] < 0:
                        found.append(head)
                        newest = t
            t += way
    return found
