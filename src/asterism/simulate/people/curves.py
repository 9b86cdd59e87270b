"""Smooth curves in time and rotations in space, from which human motion is composed."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array: TypeAlias = NDArray[np.float64]
    Knot: TypeAlias = tuple[float, ArrayLike, ArrayLike, ArrayLike]

__all__ = ["about_x", "about_y", "about_z", "blend", "harmonics", "through", "unit"]


def through(t: Array, knots: Sequence[Knot], *, derivatives: int = 0) -> Array:
    """Interpolate knots by quintics with continuous velocity and acceleration.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds; before the first knot and after the last the value is constant.
    knots : sequence of (time, value, rate, acceleration)
        In order of time, at least two; values are numbers or vectors of D.
    derivatives : int
        Number of derivatives on an additional last axis, after the value.

    Returns
    -------
    ndarray of shape (T,) or (T, D), or (T, 1 + derivatives)
    """
    from scipy.interpolate import BPoly

    times = [knot[0] for knot in knots]
    given = [[np.asarray(x, dtype=np.float64) for x in knot[1:]] for knot in knots]
    curve = BPoly.from_derivatives(times, given)
    inside = np.clip(t, times[0], times[-1])
    values = [np.asarray(curve(inside, nu), dtype=np.float64) for nu in range(derivatives + 1)]
    return np.stack(values, axis=-1) if derivatives else values[0]


def blend(t: Array, *turns: float) -> Array:
    """Blend from 0 to 1 between two times, back to 0 between the next two, and so on.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Seconds.
    *turns : float
        Pairs of times, rising: each pair begins and ends a passage, which starts and stops
        with neither velocity nor acceleration.

    Returns
    -------
    ndarray of shape (T,)
        In [0, 1].
    """
    total = np.zeros_like(t)
    for i in range(0, len(turns), 2):
        s = np.clip((t - turns[i]) / (turns[i + 1] - turns[i]), 0.0, 1.0)
        total += (1 - i % 4) * s**3 * (10 - 15 * s + 6 * s**2)
    return total


def harmonics(phase: Array, mean: float, *terms: tuple[float, float]) -> Array:
    """Sum the harmonics of a cycle: ``mean + Σ a_k cos(2π k (phase - p_k))``.

    Parameters
    ----------
    phase : ndarray of shape (T,)
        Phase in cycles.
    mean : float
        Mean over the cycle.
    *terms : (amplitude, phase of the peak)
        Amplitude and phase of the peak of the first, the second … harmonic.

    Returns
    -------
    ndarray of shape (T,)
    """
    total = np.full(phase.shape, float(mean))
    for k, (amplitude, peak) in enumerate(terms, start=1):
        total += amplitude * np.cos(2 * np.pi * k * (phase - peak))
    return total


def about_x(angle: ArrayLike) -> Array:
    """Return rotations about x, from y to z.

    Parameters
    ----------
    angle : array_like of shape (...)
        Degrees.

    Returns
    -------
    ndarray of shape (..., 3, 3)
    """
    return _about(0, angle)


def about_y(angle: ArrayLike) -> Array:
    """Return rotations about y, from z to x.

    Parameters
    ----------
    angle : array_like of shape (...)
        Degrees.

    Returns
    -------
    ndarray of shape (..., 3, 3)
    """
    return _about(1, angle)


def about_z(angle: ArrayLike) -> Array:
    """Return rotations about z, from x to y.

    Parameters
    ----------
    angle : array_like of shape (...)
        Degrees.

    Returns
    -------
    ndarray of shape (..., 3, 3)
    """
    return _about(2, angle)


def _about(axis: int, angle: ArrayLike) -> Array:
    a = np.radians(np.asarray(angle, dtype=np.float64))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.zeros((*a.shape, 3, 3))
    turn[..., axis, axis] = 1.0
    turn[..., i, i] = turn[..., j, j] = np.cos(a)
    turn[..., j, i] = np.sin(a)
    turn[..., i, j] = -turn[..., j, i]
    return turn


def unit(vectors: Array) -> Array:
    """Scale vectors to length 1.

    Parameters
    ----------
    vectors : ndarray of shape (..., 3)
        Vectors, none of them 0.

    Returns
    -------
    ndarray of shape (..., 3)
    """
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
