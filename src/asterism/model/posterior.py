"""The log posterior of a partition: the one number that every method chases.

``log π(ω) = Σ s(τ)`` over the tracks, relative to “everything is clutter”, with

    s(τ) = log λ_b - n log λ_f + n log P_d + u log(1 - P_d) + a log(1 - p_z) + log E_r
           + Σ_{i ≥ 2} log N(y_i; ŷ_i, B_i)

n detections, u undetected frames between the first and the last, a steps survived, r frames left,
E_r the probability of seeing nothing more in them (eq. 4.6 of the report, with the time of death
summed over). Tracks outside the space Ω (one detection, a gap over d̄, a link over v̄) score -inf.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism import _engine
from asterism.checks import check_kind
from asterism.model.compiled import motion_model, score_model, steps_of, with_noise
from asterism.model.tracking_model import TrackingModel
from asterism.model.tracks import Tracks

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["log_posterior", "track_scores"]


def track_scores(tracks: Tracks, model: TrackingModel) -> NDArray[np.float64]:
    """Score s(τ) of each track, in nats against its detections being clutter.

    Parameters
    ----------
    tracks : Tracks
        A partition.
    model : TrackingModel
        The model.

    Returns
    -------
    ndarray, shape (K,)
        -inf for a track that the model forbids; 0 for one without any detection.
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    d = tracks.detections
    order, offsets = tracks.by_track
    kind, F, Q = steps_of(model.motion, d.times)
    scores = _engine.score_tracks(
        motion_model(model, d.n_axes), score_model(model),
        with_noise(d.points, d.covariances)[order], d.frame_of[order], offsets, d.times, kind, F, Q,
    )  # fmt: skip
    scores[tracks.lengths == 0] = 0.0
    return scores


def log_posterior(tracks: Tracks, model: TrackingModel) -> float:
    """Log posterior of a partition, in nats above “everything is clutter”.

    Parameters
    ----------
    tracks : Tracks
        A partition.
    model : TrackingModel
        The model.

    Returns
    -------
    float
        -inf if the model forbids one of the tracks.
    """
    return float(track_scores(tracks, model).sum())
