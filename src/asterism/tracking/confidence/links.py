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

    from asterism.model import Detections, TrackingModel

__all__ = ["Exchanges", "find_exchanges"]


@record(eq=False)
class Exchanges:
    """Pairs of tracklets that may have exchanged their later parts.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        First frame of the later parts.
    pairs : ndarray of int, shape (n, 2)
        Tracklets.
    ratios : ndarray of shape (n,)
        Log-likelihood ratio of each exchange by the motion model.
    is_mutual : ndarray of bool, shape (n,)
        Whether both tracklets continue after the exchange.
    """

    frames: NDArray[np.int64]
    pairs: NDArray[np.int64]
    ratios: NDArray[np.float64]
    is_mutual: NDArray[np.bool_]

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Probability of each exchange, shape (n,)."""
        return exchange_probability(self.ratios, self.is_mutual)


def find_exchanges(
    detections: Detections, tracklets: NDArray[np.int64], model: TrackingModel
) -> Exchanges:
    """Find pairs of tracklets that may have exchanged their later parts.

    Two tracklets are compared where links of both are as probable if exchanged, by the motion
    model and the detections before and after. A tracklet that has ended shortly before may go on
    with the later part of another, and one that begins may continue another.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    tracklets : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for none.
    model : TrackingModel
        Model of motion and noise.
    """
    d = detections
    inside = np.flatnonzero(tracklets >= 0)
    order = inside[np.argsort(tracklets[inside], kind="stable")]
    offsets = np.concatenate([[0], np.cumsum(np.bincount(tracklets[inside]))]).astype(np.int64)
    kind, F, Q = steps_of(model.motion, d.times)
    frames, a, b, ratios, is_mutual = _engine.exchanges(
        motion_model(model, d.n_axes), d.times, kind, F, Q,
        np.ascontiguousarray(d.points[order]), d.frame_of[order].astype(np.int64), offsets,
        p_detection=min(model.sensor.p_detection, 0.999),
    )  # fmt: skip
    pairs = np.stack([a, b], axis=1).astype(np.int64)
    return Exchanges(frames=frames, pairs=pairs, ratios=ratios, is_mutual=is_mutual)
