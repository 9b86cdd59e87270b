"""Predicted positions of tracks, frame by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.filter.kalman import filter_states
from asterism.model import Detections
from asterism.model.compiled import steps_of

if TYPE_CHECKING:
    from asterism.model import TrackingModel, Tracks

__all__ = ["expected_positions"]


def expected_positions(tracks: Tracks, model: TrackingModel, *, coast: int = 5) -> Detections:
    """Predict the position of each track in each frame from its earlier detections.

    `asterism.multiview` uses the predictions to assign image points that several rays explain.

    Parameters
    ----------
    tracks : Tracks
        Tracks, for example of an earlier pass.
    model : TrackingModel
        Model whose motion and noise are used.
    coast : int
        Number of frames after its last detection for which a track is still predicted, ≥ 0. Larger
        values predict through longer occlusions, with larger covariances.

    Returns
    -------
    Detections
        Predictions of the same frames, ordered by track, for the tracks that started before each
        frame, with covariances (m², equal on every axis). With several motions the middle mode is
        used.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> expected_positions(truth, model).counts[:3]
    array([0, 8, 8])
    """
    states = filter_states(tracks, model)
    d = tracks.detections
    kind, F, Q = steps_of(model.motion, d.times)
    H = model.motion.modes[0].observation
    middle = len(model.motion.modes) // 2
    frames: list[np.ndarray] = []
    points: list[np.ndarray] = []
    variances: list[np.ndarray] = []
    for k in np.flatnonzero(tracks.lengths):
        rows = slice(states.offsets[k], states.offsets[k + 1])
        first, n = int(states.first_frames[k]), int(states.offsets[k + 1] - states.offsets[k])
        means, P = states.means[rows], states.covariances[rows]
        # The last state is predicted over all coasting frames; each earlier one over one step.
        beyond = min(coast, d.n_frames - first - n)
        step = kind[first + 1 : first + n + beyond]
        at = np.arange(first + 1, first + n + beyond)
        x, S = list(means), list(P)
        for t in range(n, n + beyond - 1):
            A = F[kind[first + t], middle]
            x.append(x[-1] @ A.T)
            S.append(A @ S[-1] @ A.T + Q[kind[first + t], middle])
        A, B = F[step, middle], Q[step, middle]
        before, spread = np.array(x)[: len(at)], np.array(S)[: len(at)]
        frames.append(at)
        points.append(np.einsum("tij,tdj->tdi", A, before) @ H)
        variances.append(np.einsum("i,tij,j->t", H, A @ spread @ A.transpose(0, 2, 1) + B, H))
    at = np.concatenate([*frames, np.empty(0, dtype=np.int64)])
    order = np.argsort(at, kind="stable")
    D = d.n_axes
    var = np.concatenate([*variances, np.empty(0)])[order]
    return Detections(
        times=d.times,
        offsets=np.concatenate([[0], np.cumsum(np.bincount(at, minlength=d.n_frames))]),
        points=np.concatenate([*points, np.empty((0, D))])[order],
        covariances=var[:, None, None] * np.eye(D),
    )
