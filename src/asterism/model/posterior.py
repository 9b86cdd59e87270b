"""Log posterior of a partition, which every method maximises or samples.

``log π(ω) = Σ s(τ)`` over the tracks, relative to the partition in which all is clutter, with

    s(τ) = log λ_b - n log λ_f + n log P_d + u log(1 - P_d) + a log(1 - p_z) + log E_r
           + Σ_{i ≥ 2} log N(y_i; ŷ_i, B_i)

n detections, u missed detections between the first and the last, a steps survived, r frames left,
E_r the probability of no detection in them (eq. 4.6 of the report, summed over the time of death).
Tracks outside the space Ω (one detection, a gap over d̄, a link over v̄) score -inf.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.checks import check_kind
from asterism.model.compiled import motion_model, score_model, steps_of, with_noise
from asterism.model.tracking_model import TrackingModel
from asterism.model.tracks import Tracks

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["log_posterior", "track_scores"]

SCORED_POINTS = 500_000
"""Number of detections whose tracks are scored in a call."""


def track_scores(tracks: Tracks, model: TrackingModel) -> NDArray[np.float64]:
    """Compute the score s(τ) of each track: its log-likelihood ratio against clutter, in nats.

    Parameters
    ----------
    tracks : Tracks
        Partition of the detections into tracks and clutter.
    model : TrackingModel
        Model that assigns the scores.

    Returns
    -------
    ndarray of shape (K,)
        -inf for a track that the model forbids; 0 for a track without a detection.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> bool((am.model.track_scores(truth, model) > 0).all())
    True
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    d = tracks.detections
    order, offsets = tracks.by_track
    kind, F, Q = steps_of(model.motion, d.times)
    points = with_noise(d.points, d.covariances)
    scores = np.zeros(tracks.n_tracks)
    k = 0
    while k < tracks.n_tracks:  # in parts, whose copies take little memory
        last = int(np.searchsorted(offsets, offsets[k] + SCORED_POINTS, side="right")) - 1
        end = max(last, k + 1)
        own = order[offsets[k] : offsets[end]]
        scores[k:end] = _engine.score_tracks(
            motion_model(model, d.n_axes), score_model(model), points[own], d.frame_of[own],
            offsets[k : end + 1] - offsets[k], d.times, kind, F, Q,
        )  # fmt: skip
        k = end
    scores[tracks.lengths == 0] = 0.0
    return scores


def log_posterior(tracks: Tracks, model: TrackingModel) -> float:
    """Compute the log posterior of a partition, relative to all detections being clutter, in nats.

    Parameters
    ----------
    tracks : Tracks
        Partition of the detections into tracks and clutter.
    model : TrackingModel
        Model that assigns the posterior.

    Returns
    -------
    float
        -inf if the model forbids one of the tracks.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> am.log_posterior(truth, model) > 0
    True
    """
    return float(track_scores(tracks, model).sum())
