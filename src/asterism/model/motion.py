"""How a marker moves: linear motion models, the same on every axis.

With isotropic noise the axes do not mix, so a model speaks of one axis: ``n`` states, a transition
F, a process noise Q and an observation H. Symbols: Δ time from frame to frame in seconds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from asterism.checks import check_number
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DWNA", "DWPA", "Motion", "RandomWalk", "SingleMotion"]


class Motion(ABC):
    """How a marker moves: one motion, or several among which it changes.

    See `DWNA`, `RandomWalk`, `DWPA`, `LinearMotion`, `InteractingMotions`.
    """

    kind: ClassVar[str]
    """The motion's name in a model file."""

    @property
    @abstractmethod
    def modes(self) -> tuple[SingleMotion, ...]:
        """The M motions among which a marker changes, of equal states and observation."""

    @property
    @abstractmethod
    def mode_transitions(self) -> NDArray[np.float64]:
        """Probability of going from mode (row) to mode (column) in a step, shape (M, M)."""


class SingleMotion(Motion):
    """One linear motion of one axis with n states."""

    @property
    def modes(self) -> tuple[SingleMotion, ...]:
        """Itself alone."""
        return (self,)

    @property
    def mode_transitions(self) -> NDArray[np.float64]:
        """``[[1]]``."""
        return np.ones((1, 1))

    @property
    @abstractmethod
    def observation(self) -> NDArray[np.float64]:
        """The row H, shape (n,): position = H · state."""

    @abstractmethod
    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """F for each Δ of `dt` (M,), shape (M, n, n)."""

    @abstractmethod
    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Q for each Δ of `dt` (M,), shape (M, n, n)."""

    @abstractmethod
    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Covariance of the state right after the first detection, shape (n, n).

        Parameters
        ----------
        noise_sigma : float
            Standard deviation of a measured coordinate, metres.
        velocity_sigma : float
            Prior standard deviation of a velocity coordinate, m/s, where the model leaves its own
            open.
        """


def _steps(dt: ArrayLike) -> NDArray[np.float64]:
    return np.atleast_1d(np.asarray(dt, dtype=np.float64))


def _stack(rows: list[list[NDArray[np.float64]]]) -> NDArray[np.float64]:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@record
class DWNA(SingleMotion):
    """Discrete white noise acceleration: constant velocity, shaken once a step.

    ``F = [1 Δ; 0 1]``, ``Q = σ_a² [Δ⁴/4 Δ³/2; Δ³/2 Δ²]``, ``H = [1 0]`` (Bar-Shalom, Li &
    Kirubarajan 2001, eq. 6.3.2-3; §5.6 of the report).

    Parameters
    ----------
    acceleration_sigma : float
        σ_a, m/s².
    velocity_sigma : float, optional
        Prior standard deviation of a velocity coordinate, m/s; the population's maximal speed
        decides where it is left out.
    """

    acceleration_sigma: float
    velocity_sigma: float | None = None

    kind: ClassVar[str] = "dwna"

    def __post_init__(self) -> None:
        check_number("acceleration_sigma", self.acceleration_sigma, above=0, below=1e12)
        if self.velocity_sigma is not None:
            check_number("velocity_sigma", self.velocity_sigma, above=0, below=1e12)

    @property
    def observation(self) -> NDArray[np.float64]:
        """``H = [1 0]``."""
        return np.array([1.0, 0.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """F for each Δ of `dt` (M,), shape (M, 2, 2)."""
        d = _steps(dt)
        one, zero = np.ones_like(d), np.zeros_like(d)
        return _stack([[one, d], [zero, one]])

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Q for each Δ of `dt` (M,), shape (M, 2, 2)."""
        d = _steps(dt)
        return self.acceleration_sigma**2 * _stack([[d**4 / 4, d**3 / 2], [d**3 / 2, d**2]])

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """``diag(σ², σ_v²)``, shape (2, 2)."""
        return np.diag([noise_sigma**2, (self.velocity_sigma or velocity_sigma) ** 2])


@record
class RandomWalk(SingleMotion):
    """Random walk: one state, ``F = 1``, ``Q = σ_w² Δ``.

    Parameters
    ----------
    walk_sigma : float
        σ_w, m/√s: the standard deviation of a coordinate after one second.
    """

    walk_sigma: float

    kind: ClassVar[str] = "random_walk"

    def __post_init__(self) -> None:
        check_number("walk_sigma", self.walk_sigma, above=0, below=1e12)

    @property
    def observation(self) -> NDArray[np.float64]:
        """``H = [1]``."""
        return np.array([1.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Ones, shape (M, 1, 1)."""
        return np.ones((len(_steps(dt)), 1, 1))

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """``σ_w² Δ``, shape (M, 1, 1)."""
        return self.walk_sigma**2 * _steps(dt)[:, None, None]

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """``σ²``, shape (1, 1); there is no velocity."""
        return np.array([[noise_sigma**2]])


@record
class DWPA(SingleMotion):
    """Discrete Wiener process acceleration: the acceleration itself walks.

    ``F = [1 Δ Δ²/2; 0 1 Δ; 0 0 1]``, ``Q = σ_j² g gᵀ`` with ``g = (Δ²/2, Δ, 1)`` (Bar-Shalom, Li &
    Kirubarajan 2001, eq. 6.3.3-2).

    Parameters
    ----------
    increment_sigma : float
        Standard deviation of the change of acceleration in one step, m/s².
    acceleration_prior_sigma : float
        Prior standard deviation of an acceleration coordinate, m/s².
    velocity_sigma : float, optional
        Prior standard deviation of a velocity coordinate, m/s, as in `DWNA`.
    """

    increment_sigma: float
    acceleration_prior_sigma: float
    velocity_sigma: float | None = None

    kind: ClassVar[str] = "dwpa"

    def __post_init__(self) -> None:
        check_number("increment_sigma", self.increment_sigma, above=0, below=1e12)
        check_number("acceleration_prior_sigma", self.acceleration_prior_sigma, above=0, below=1e12)
        if self.velocity_sigma is not None:
            check_number("velocity_sigma", self.velocity_sigma, above=0, below=1e12)

    @property
    def observation(self) -> NDArray[np.float64]:
        """``H = [1 0 0]``."""
        return np.array([1.0, 0.0, 0.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """F for each Δ of `dt` (M,), shape (M, 3, 3)."""
        d = _steps(dt)
        one, zero = np.ones_like(d), np.zeros_like(d)
        return _stack([[one, d, d**2 / 2], [zero, one, d], [zero, zero, one]])

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Q for each Δ of `dt` (M,), shape (M, 3, 3)."""
        d = _steps(dt)
        g = np.stack([d**2 / 2, d, np.ones_like(d)], axis=-1)
        return self.increment_sigma**2 * g[:, :, None] * g[:, None, :]

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """``diag(σ², σ_v², σ_α²)``, shape (3, 3)."""
        return np.diag(
            [
                noise_sigma**2,
                (self.velocity_sigma or velocity_sigma) ** 2,
                self.acceleration_prior_sigma**2,
            ]
        )
