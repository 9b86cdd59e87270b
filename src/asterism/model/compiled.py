"""A model in the form that the engine takes.

What this file is not: a place for arithmetic. It names the engine's arguments once, so that the
posterior, the filters and the methods cannot differ in them.
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
"""A link may be longer than v̄ Δτ by so many σ, for the noise of its two ends."""


@lru_cache(maxsize=64)
def motion_model(model: TrackingModel, n_axes: int) -> _engine.MotionModel:
    """Give the motion and noise of one axis, as the engine takes them."""
    return _engine.MotionModel.make(
        n_axes,
        np.ascontiguousarray(model.motion.modes[0].observation),
        np.ascontiguousarray(model.initial_covariance(n_axes)),
        model.sensor.noise_sigma,
        np.ascontiguousarray(model.motion.mode_transitions),
    )


@lru_cache(maxsize=64)
def score_model(model: TrackingModel) -> _engine.ScoreModel:
    """Give the parameters of s(τ), as the engine takes them."""
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
    # Times such as k / 120 differ in their last bits; rounded, equal spacings are equal, and a
    # stream and a batch see the same numbers.
    return np.maximum(np.round(dt, 9), 1e-9)


@lru_cache(maxsize=1024)
def transition(motion: Motion, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """F and Q of every mode, each (modes, n, n), over `dt` seconds."""
    F, Q = _of_modes(motion, _to_nanosecond(np.array([dt])))
    return F[0], Q[0]


def no_transition(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """F and Q of the step before the first frame, which moves nothing."""
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
    """List the steps of a whole capture: which kind leads to each frame, and F and Q of each kind.

    Returns
    -------
    kind : ndarray of int32, shape (T,)
        Kind of the step from frame t - 1 to t; 0 at the first frame, which nothing leads to.
    F, Q : ndarray, shape (kinds, modes, n, n)
        Of each kind, of which there is at least one.
    """
    if len(times) < 2:
        still, quiet = no_transition(motion)
        return np.zeros(len(times), np.int32), still[None], quiet[None]
    spacing, kind = np.unique(_to_nanosecond(np.diff(times)), return_inverse=True)
    F, Q = _of_modes(motion, spacing)
    return np.concatenate([[0], kind]).astype(np.int32), F, Q


def with_noise(
    points: NDArray[np.float64], covariances: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Give points as the engine takes them, with the noise that is theirs beyond the sensor's.

    The axes of a track share one covariance, so of the covariance of a point the mean variance of
    its coordinates is taken: exact for isotropic ones.

    Parameters
    ----------
    points : ndarray, shape (N, D)
        Metres.
    covariances : ndarray, shape (N, D, D), or None
        Of the points, m².

    Returns
    -------
    ndarray, shape (N, D) or (N, D + 1)
        With a column more where there are covariances.
    """
    if covariances is None:
        return points
    variances = np.trace(covariances, axis1=1, axis2=2) / points.shape[1]
    return np.column_stack([points, variances])
