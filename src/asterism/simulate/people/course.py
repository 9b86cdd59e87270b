"""Course of a person: speed and heading over time, and the resulting position on the ground."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.interpolate import CubicSpline

    from asterism.simulate.people.curves import Array

__all__ = ["STEP", "Course"]

STEP = 0.01
"""Seconds between samples of what is integrated or filtered."""

_PAD = 1.5  # seconds of the course before and after the scene


@dataclass(frozen=True, eq=False, kw_only=True)
class Course:
    """Course of a person: position, heading and speed over time.

    Parameters
    ----------
    duration : float
        Duration of the scene, seconds.
    speed, heading : callable
        Functions of times (T,): forward speed, m/s, and direction, radians.
    middle : (float, float)
        Position at half time, metres.
    usual : float
        Speed at which the gait has its full amplitude, m/s.
    times : ndarray of shape (n,)
        Times at which the course is sampled, which are computed, seconds.
    """

    duration: float
    speed: Callable[[Array], Array]
    heading: Callable[[Array], Array]
    middle: tuple[float, float] = (0.0, 0.0)
    usual: float
    times: Array = field(init=False, repr=False)
    _curve: CubicSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        from scipy.interpolate import CubicSpline

        n = int(np.ceil((self.duration + 2 * _PAD) / STEP)) + 1
        times = np.asarray(-_PAD + STEP * np.arange(n), dtype=np.float64)
        way = CubicSpline(times, self.velocity(times)).antiderivative()
        middle = np.asarray(way(self.duration / 2)) - self.middle
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "_curve", CubicSpline(times, np.asarray(way(times)) - middle))

    def velocity(self, t: Array) -> Array:
        """Return the velocity over the ground.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        ndarray of shape (T, 2)
        """
        heading = self.heading(t)
        return self.speed(t)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)

    def place(self, t: Array) -> Array:
        """Return the position on the ground.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        ndarray of shape (T, 2)
        """
        inside = np.clip(t, self.times[0], self.times[-1])
        return np.asarray(self._curve(inside), dtype=np.float64)

    def vigour(self, t: Array) -> Array:
        """Return the speed relative to the usual one, in [0, 1]; 0 also for backward motion.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        ndarray of shape (T,)
        """
        return np.clip(self.speed(t) / self.usual, 0.0, 1.0)
