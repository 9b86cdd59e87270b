"""Conversion of a model to the engine's arguments.

The engine's arguments are made in this file alone, so that the posterior, the filters and the
methods use the same ones. There is no other arithmetic here.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model.motion import Motion
    from asterism.model.tracking_model import TrackingModel

__all__ = [
    "SPEED_MARGIN_SIGMAS",
    "motion_model",
    "no_transition",
    "score_model",
    "steps_of",
    "transition",
    "with_noise",
]

SPEED_MARGIN_SIGMAS = 6.0
"""Number of σ by which a link may exceed v̄ Δτ, because both of its ends are noisy."""


@lru_cache(maxsize=64)
def motion_model(model: TrackingModel, n_axes: int) -> _engine.MotionModel:
    """Return the motion and noise of one axis as an engine object."""
    return _engine.MotionModel.make(
        n_axes,
        np.ascontiguousarray(model.motion.modes[0].observation),
        np.ascontiguousarray(model.initial_covariance(n_axes)),
        model.sensor.noise_sigma,
        np.ascontiguousarray(model.motion.mode_transitions),
    )


@lru_cache(maxsize=64)
def score_model(model: TrackingModel) -> _engine.ScoreModel:
    """Return the parameters of the track score s(τ) as an engine object."""
    return _engine.ScoreModel(
        birth_density=model.population.birth_density,
        clutter_density=model.sensor.clutter_density,
        p_detection=model.sensor.p_detection,
        p_redetection=model.sensor.p_after_miss,
        p_disappear=model.population.p_disappear,
        max_speed=model.population.max_speed,
        speed_margin=SPEED_MARGIN_SIGMAS * model.sensor.noise_sigma,
        max_gap=model.population.max_gap,
        last_termination=model.population.termination == "last",
    )


def _to_nanosecond(dt: NDArray[np.float64]) -> NDArray[np.float64]:
    # Differences of times such as k / 120 differ in their last bits. Rounding makes equal spacings
    # equal, so that a stream and a batch use the same numbers.
    return np.maximum(np.round(dt, 9), 1e-9)


@lru_cache(maxsize=1024)
def transition(motion: Motion, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return F and Q of every mode over `dt` seconds, each of shape (modes, n, n)."""
    F, Q = _of_modes(motion, _to_nanosecond(np.array([dt])))
    return F[0], Q[0]


def no_transition(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return F = 1 and Q = 0 of every mode, for the first frame, which has no step before it."""
    n, M = len(motion.modes[0].observation), len(motion.modes)
    return np.broadcast_to(np.eye(n), (M, n, n)).copy(), np.zeros((M, n, n))


def _of_modes(
    motion: Motion, dt: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    F = np.stack([mode.transition(dt) for mode in motion.modes], axis=1)
    Q = np.stack([mode.process_noise(dt) for mode in motion.modes], axis=1)
    return np.ascontiguousarray(F), np.ascontiguousarray(Q)


def steps_of(
    motion: Motion, times: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Group the steps of a capture by duration, and compute F and Q once for each duration.

    Returns
    -------
    kind : ndarray of int32, shape (T,)
        Kind of the step from frame t - 1 to t; 0 at the first frame, which has no step.
    F, Q : ndarray of shape (kinds, modes, n, n)
        Transition and process noise of each kind; there is at least one kind.
    """
    if len(times) < 2:
        still, quiet = no_transition(motion)
        return np.zeros(len(times), np.int32), still[None], quiet[None]
    spacing = _to_nanosecond(np.diff(times))
    if (spacing == spacing[0]).all():  # as in most captures, and faster than sorting
        F, Q = transition(motion, float(spacing[0]))
        return np.zeros(len(times), np.int32), F[None], Q[None]
    spacing, kind = np.unique(spacing, return_inverse=True)
    F, Q = _of_modes(motion, spacing)
    return np.concatenate([[0], kind]).astype(np.int32), F, Q


def with_noise(
    points: NDArray[np.float64], covariances: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Return points for the engine, with the variance of each point in a further column.

    The axes of a track share one covariance. The covariance of a point is therefore replaced by the
    mean variance of its coordinates, which is exact for isotropic covariances.

    Parameters
    ----------
    points : ndarray of shape (N, D)
        Positions, metres.
    covariances : ndarray of shape (N, D, D), or None
        Covariance of each point, m², added to the sensor's noise.

    Returns
    -------
    ndarray of shape (N, D) or (N, D + 1)
        D + 1 columns if there are covariances, otherwise `points` itself.
    """
    if covariances is None:
        return points
    variances = np.trace(covariances, axis1=1, axis2=2) / points.shape[1]
    return np.column_stack([points, variances])
