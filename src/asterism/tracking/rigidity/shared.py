"""Shared accelerations of markers, learnt from the tracks of a capture."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.model import TrackingModel, Tracks
from asterism.model.shared_acceleration import (
    COMPONENTS,
    N_OWN,
    SharedAcceleration,
    shared_densities,
)
from asterism.tracking.rigidity.distances import Distances, distances_between
from asterism.tracking.rigidity.sampled import sampled_positions
from asterism.tracking.rigidity.shared_size import shared_size

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["fitted_weights", "learn_shared_acceleration"]

MAX_BONDS, MAX_COMPARED = 16, 8
"""Number of steadiest bonds of a marker, and of those by which the frame of its shape is chosen."""
MISSING = 4.0
"""Squared deviation, in variances, that counts for a distance that is missing in a frame, and the
largest that counts."""
PRIOR = 20.0
"""Detections for which the weights of all markers count in those of each marker."""
MIN_OWN = 0.03
"""Minimum weight of a marker's own motion, and of the volume for a first detection: neighbours may
move otherwise than where it was learnt."""
ROUNDS = 30
"""Number of iterations of the weights."""


def learn_shared_acceleration(tracks: Tracks, model: TrackingModel) -> SharedAcceleration:
    """Learn from tracks how their markers accelerate together.

    Bonds are those of all distances, and a marker comes after those of smaller number. Its shape is
    the positions in the frame whose distances are most usual. The weights of the predictions
    maximise the density of the detections (EM); those of each marker are drawn to those of all, and
    that of own motion is at least `MIN_OWN`. The weights of a first detection are learnt from all
    detections, as if each began a track. The acceleration in common is that of markers which
    neighbours predict better than own motion does, each with its steadiest bond (`shared_size`).

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture, most of whose identities are right.
    model : TrackingModel
        Model of their own motion.

    Returns
    -------
    SharedAcceleration

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.swarm(frames=300, seed=1)  # independent markers
    >>> model = am.estimate_model(truth.detections).model
    >>> am.tracking.learn_shared_acceleration(truth, model)
    SharedAcceleration(30 markers, 72 bonds, nothing in common, weight of own motion 0.98)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    K, D = tracks.n_tracks, tracks.detections.n_axes
    positions = sampled_positions(tracks.detections, tracks.labels, K)
    distances = distances_between(positions)
    variance = distances.predictive_variance
    offsets, all_others = [0], [np.empty(0, dtype=np.int64)]
    shape, own_shape = [np.empty((0, D))], np.zeros((K, D))
    for k in range(K):
        others = np.flatnonzero(distances.is_bond[k, :k])
        others = others[np.argsort(variance[k, others], kind="stable")][:MAX_BONDS]
        if len(others):
            usual = _usual_frame(positions, k, others[:MAX_COMPARED], distances)
            own_shape[k] = positions[usual, k]
            shape.append(positions[usual, others])
        all_others.append(others)
        offsets.append(offsets[-1] + len(others))
    others = np.concatenate(all_others)
    marker = np.repeat(np.arange(K), np.diff(offsets))
    equal = np.ones((K, len(COMPONENTS))) / len(COMPONENTS)
    shared = SharedAcceleration(
        offsets=np.array(offsets), others=others.astype(np.int32),
        distances=distances.middle[marker, others], variances=variance[marker, others],
        shape=np.concatenate(shape), own_shape=own_shape,
        weights=equal, begin_weights=equal, volume=_volume(tracks.detections.points),
    )  # fmt: skip
    begin_weights = fitted_weights(_as_first(tracks, model, shared), tracks.labels, K)
    densities, predicted = shared_densities(tracks, model, shared)
    densities[np.isnan(predicted[:, 0])] = np.nan
    weights = fitted_weights(densities, tracks.labels, K)
    is_led = (weights[:, :N_OWN].sum(axis=1) < 0.5) & (np.diff(offsets) > 0)
    steadiest = np.array(offsets[:-1], dtype=np.int64)[is_led]
    size, size_std = shared_size(tracks, marker[steadiest], others[steadiest])
    return dataclasses.replace(
        shared, weights=weights, begin_weights=begin_weights, size=size, size_std=size_std
    )


def _volume(points: NDArray[np.float64]) -> float:
    """Return the volume of all points, as in the densities per volume of an estimated model."""
    extent = np.ptp(points, axis=0) if len(points) else np.zeros(points.shape[1])
    return float(np.prod(np.maximum(extent, 0.1 * max(extent.max(), 1e-3))))


def _as_first(
    tracks: Tracks, model: TrackingModel, shared: SharedAcceleration
) -> NDArray[np.float64]:
    """Return the log densities, shape (N, C), of all detections as if each began a track."""
    has = np.flatnonzero(tracks.labels >= 0)
    labels = np.full(len(tracks.labels), -1)
    labels[has] = np.arange(len(has))
    apart = Tracks(detections=tracks.detections, labels=labels)
    return shared_densities(apart, model, shared, tracks.labels[has])[0]


def _usual_frame(
    positions: NDArray[np.float64], k: int, others: NDArray[np.int64], distances: Distances
) -> int:
    """Return the frame in which the distances of marker k deviate least from the usual ones."""
    apart = np.sqrt(((positions[:, others] - positions[:, [k]]) ** 2).sum(axis=2))
    off = apart - distances.middle[k, others]
    squares = np.minimum(off**2 / distances.predictive_variance[k, others], MISSING)
    sums = np.nan_to_num(squares, nan=MISSING).sum(axis=1)
    sums[~np.isfinite(positions[:, k, 0])] = np.inf
    return int(sums.argmin())


def fitted_weights(
    densities: NDArray[np.float64], labels: NDArray[np.int64], n_markers: int
) -> NDArray[np.float64]:
    """Fit the weights of the components for each marker, which maximise the density.

    Parameters
    ----------
    densities : ndarray of shape (N, C)
        Log densities of `shared_densities`; -inf excludes a component.
    labels : ndarray of int, shape (N,)
        Marker of each detection.
    n_markers : int
        Number of markers K.

    Returns
    -------
    ndarray of shape (K, C)
        Weights with the sum 1 for each marker.
    """
    n = densities.shape[1]
    has = np.isfinite(densities).sum(axis=1) > 1
    densities, labels = densities[has], labels[has]
    alone = np.zeros((n_markers, n))
    alone[:, 0] = 1.0
    if not len(labels):
        return alone
    relative = np.exp(densities - densities.max(axis=1, keepdims=True))
    common = np.full(n, 1 / n)
    for _ in range(ROUNDS):
        share = relative * common
        share /= share.sum(axis=1, keepdims=True)
        common = share.mean(axis=0)
    weights = np.tile(common, (n_markers, 1))
    for _ in range(ROUNDS):
        share = relative * weights[labels]
        share /= share.sum(axis=1, keepdims=True)
        sums = np.stack(
            [np.bincount(labels, each, minlength=n_markers) for each in share.T], axis=1
        )
        weights = (sums + PRIOR * common) / (sums.sum(axis=1, keepdims=True) + PRIOR)
    return (1 - MIN_OWN) * weights + MIN_OWN * alone
