"""Confidence of links from the alternatives that the motion model allows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.records import record
from asterism.tracking.confidence.calibration import exchange_probability

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks

__all__ = ["Exchanges", "find_exchanges"]


CHUNK, MARGIN = 4000, 64
"""Number of frames that are searched at a time, and of those around that are looked at, in which a
link can be too. They bound the memory, and do not depend on the length of the capture."""


@record(eq=False)
class Exchanges:
    """Places where two tracks may have exchanged their later parts.

    Parameters
    ----------
    before, after : ndarray of int, shape (n, 2)
        Last detection of the earlier part, and first detection of the later part, of both tracks;
        -1 for a track that begins or ends there.
    ratios : ndarray of shape (n,)
        Log-likelihood ratio of each exchange by the motion model.
    """

    before: NDArray[np.int64]
    after: NDArray[np.int64]
    ratios: NDArray[np.float64]

    @property
    def is_mutual(self) -> NDArray[np.bool_]:
        """Whether both tracks continue, shape (n,)."""
        return np.minimum(self.before, self.after).min(axis=1) >= 0

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Probability of each exchange, shape (n,)."""
        return exchange_probability(self.ratios, self.is_mutual)

    def tracks(self, labels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the tracks of both sides by the label of each detection, shape (n, 2)."""
        return labels[np.where(self.after >= 0, self.after, self.before)]


def find_exchanges(
    tracks: Tracks,
    tracklets: NDArray[np.int32] | NDArray[np.int64],
    model: TrackingModel,
    *,
    threads: int = 1,
) -> Exchanges:
    """Find places where two tracks may have exchanged their later parts.

    Two tracklets are compared where their links are as probable if exchanged, by the motion model
    and the detections before and after. A tracklet that has ended shortly before may go on with the
    later part of another, and one that begins may continue another.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the capture.
    tracklets : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for none; the labels of the tracks, if no join made them.
    model : TrackingModel
        Model of motion and noise.
    threads : int
        Number of threads, which search pieces of time; it has no influence on the result.

    Returns
    -------
    Exchanges
        Exchanges between different tracks.
    """
    d = tracks.detections
    steps = steps_of(model.motion, d.times)
    found: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]] = []
    for begin in range(0, d.n_frames, CHUNK):
        low, high = max(begin - MARGIN, 0), min(begin + CHUNK + MARGIN, d.n_frames)
        found.append(_in_frames(tracks, tracklets, model, steps, (low, high), begin, threads))
    both = [np.concatenate(each) for each in zip(*found, strict=True)] if found else []
    if not both:
        none = np.empty((0, 2), dtype=np.int64)
        return Exchanges(before=none, after=none, ratios=np.empty(0))
    exchanges = Exchanges(before=both[0], after=both[1], ratios=both[2])
    sides = exchanges.tracks(tracks.labels)
    kept = sides[:, 0] != sides[:, 1]
    return Exchanges(before=both[0][kept], after=both[1][kept], ratios=both[2][kept])


def _in_frames(
    tracks: Tracks,
    tracklets: NDArray[np.int32] | NDArray[np.int64],
    model: TrackingModel,
    steps: tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]],
    frames: tuple[int, int],
    begin: int,
    threads: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return (before, after, ratios) of the exchanges in `CHUNK` frames from `begin`."""
    d, (low, high), (kind, F, Q) = tracks.detections, frames, steps
    first = int(d.offsets[low])
    rows = slice(first, int(d.offsets[high]))
    # A tracklet that is in several tracks is one piece in each of them, and a long gap, as an edit
    # leaves it in a tracklet, ends a piece.
    inside = np.flatnonzero(tracklets[rows] >= 0)
    keys = [tracks.labels[rows][inside] + 1, tracklets[rows][inside]]
    order = np.lexsort([_short(key) for key in keys])
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = np.logical_or(*(np.diff(key[order]) != 0 for key in keys))
    own = inside[order] + first
    frame = d.frame_of[own].astype(np.int64) - low
    is_first[1:] |= np.diff(frame) > MARGIN
    offsets = np.append(np.flatnonzero(is_first), len(own)).astype(np.int64)
    before, after, ratios, cut = _engine.exchanges(
        motion_model(model, d.n_axes), d.times[low:high], kind[low:high], F, Q,
        np.ascontiguousarray(d.points[own]), frame, offsets,
        p_detection=min(model.sensor.p_detection, 0.999), n_threads=threads,
    )  # fmt: skip
    kept = (cut + low >= begin) & (cut + low < begin + CHUNK)
    own = np.append(own, -1)
    return own[before[kept]], own[after[kept]], ratios[kept]


def _short(
    values: NDArray[np.int32] | NDArray[np.int64],
) -> NDArray[np.uint16] | NDArray[np.int32] | NDArray[np.int64]:
    """Return the values in 16 bits if they fit: NumPy sorts these in linear time."""
    return values.astype(np.uint16) if values.max(initial=0) <= np.iinfo(np.uint16).max else values
