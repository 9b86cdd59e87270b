"""Maximisation of a log likelihood in a box, by a quasi-Newton method.

Gradient and curvatures along the parameters are differences over a tenth: the likelihood of several
motions is rough on a smaller scale. BFGS updates improve the curvature.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["maximise"]

MAX_STEPS = 20
MAX_HALVINGS = 6
MAX_STEP = 0.4
"""Largest change of a parameter, a logarithm, in a step. Larger steps from afar reach maxima at
which a mode explains nothing but wrong links."""
NEAR = 0.1
"""Distance of the differences from which gradient and curvatures follow."""
ENOUGH = 0.1
"""Expected gain of a step, nats, below which the search ends. Such a step changes a parameter by
less than half of its standard deviation."""
MIN_CURVATURE = 1.0
"""Smallest first curvature along a parameter, nats. It bounds steps along parameters on which the
likelihood hardly depends."""


def maximise(
    log_likelihoods: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    start: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float]:
    """Maximise a log likelihood in a box.

    Parameters
    ----------
    log_likelihoods : callable
        Function of parameter sets, shape (m, n), that returns their log likelihoods, shape (m,).
    start : ndarray of shape (n,)
        First parameters.
    low, high : ndarray of shape (n,)
        Bounds of the parameters.

    Returns
    -------
    parameters : ndarray of shape (n,)
    log_likelihood : float

    Examples
    --------
    >>> peak = np.array([0.3, 2.0])
    >>> found, value = maximise(
    ...     lambda x: -50 * ((x - peak) ** 2).sum(axis=1), np.zeros(2), -np.ones(2),
    ...     np.array([1.0, 1.5]))
    >>> np.round(found, 6), round(value, 6)
    (array([0.3, 1.5]), -12.5)
    """
    n = len(start)
    nearby = NEAR * np.vstack([np.eye(n), -np.eye(n)])

    def value_at(x: NDArray[np.float64]) -> float:
        return float(log_likelihoods(x[None])[0])

    def values_around(x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values above and below along each parameter, shape (2, n)."""
        return np.asarray(log_likelihoods(x + nearby)).reshape(2, n)

    x = np.clip(start, low, high)
    value = value_at(x)
    up, down = values_around(x)
    gradient = (up - down) / (2 * NEAR)
    along = (2 * value - up - down) / NEAR**2
    curvature = np.diag(np.maximum(np.abs(along), MIN_CURVATURE))
    for _ in range(MAX_STEPS):
        is_free = ~((x <= low) & (gradient < 0) | (x >= high) & (gradient > 0))
        step = np.zeros(n)
        if is_free.all():
            step = np.linalg.solve(curvature, gradient)
        else:
            step[is_free] = np.linalg.solve(curvature[is_free][:, is_free], gradient[is_free])
        if not 0.5 * gradient @ step > ENOUGH:
            break
        step *= min(1.0, MAX_STEP / float(np.abs(step).max()))
        for _ in range(MAX_HALVINGS):
            following = np.minimum(np.maximum(x + step, low), high)
            if (reached := value_at(following)) > value:
                break
            step /= 2
        else:
            break
        up, down = values_around(following)
        slope = (up - down) / (2 * NEAR)
        _update(curvature, following - x, gradient - slope)
        x, value, gradient = following, reached, slope
    return x, value


def _update(
    curvature: NDArray[np.float64], change: NDArray[np.float64], fall: NDArray[np.float64]
) -> None:
    """Update a curvature in place by BFGS, if it stays positive definite.

    Parameters
    ----------
    curvature : ndarray of shape (n, n)
        Approximate curvature.
    change, fall : ndarray of shape (n,)
        Change of the parameters, and fall of the gradient over it.
    """
    bent = curvature @ change
    expected = float(bent @ change)
    if (found := float(fall @ change)) > 0.01 * expected:
        curvature += fall[:, None] * fall / found - bent[:, None] * bent / expected
