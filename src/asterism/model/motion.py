"""Linear motion models of a marker, the same on every axis.

With isotropic noise the axes are independent, so a model describes one axis: ``n`` states, a
transition F, a process noise Q and an observation H. Symbol: Δ, the time between frames in seconds.
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
    """Motion model of a marker: one motion, or several modes between which it switches.

    See `DWNA`, `RandomWalk`, `DWPA`, `LinearMotion`, `InteractingMotions`.

    Examples
    --------
    >>> import asterism as am
    >>> motion = am.DWNA(acceleration_sigma=30)
    >>> len(motion.modes), motion.mode_transitions
    (1, array([[1.]]))
    """

    kind: ClassVar[str]
    """Name of the motion in a model file."""

    @property
    @abstractmethod
    def modes(self) -> tuple[SingleMotion, ...]:
        """The M motions between which a marker switches, all with equal states and observation."""

    @property
    @abstractmethod
    def mode_transitions(self) -> NDArray[np.float64]:
        """Probability of switching from mode (row) to mode (column) in a step, shape (M, M)."""


class SingleMotion(Motion):
    """Linear motion of one axis with n states, the only mode.

    Examples
    --------
    >>> import asterism as am
    >>> motion = am.RandomWalk(walk_sigma=0.1)
    >>> motion.modes, motion.mode_transitions, motion.observation
    ((RandomWalk(walk_sigma=0.1),), array([[1.]]), array([1.]))
    """

    @property
    def modes(self) -> tuple[SingleMotion, ...]:
        """Tuple of this motion alone."""
        return (self,)

    @property
    def mode_transitions(self) -> NDArray[np.float64]:
        """Transition probability of the only mode, ``[[1]]``."""
        return np.ones((1, 1))

    @property
    @abstractmethod
    def observation(self) -> NDArray[np.float64]:
        """Observation row H, shape (n,): position = H · state."""

    @abstractmethod
    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return F for each Δ of `dt` (M,), shape (M, n, n).

        Parameters
        ----------
        dt : array_like of shape (M,)
            Durations Δ, seconds.

        Examples
        --------
        >>> import asterism as am
        >>> am.RandomWalk(walk_sigma=0.1).transition([0.01])
        array([[[1.]]])
        """

    @abstractmethod
    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return Q for each Δ of `dt` (M,), shape (M, n, n).

        Parameters
        ----------
        dt : array_like of shape (M,)
            Durations Δ, seconds.

        Examples
        --------
        >>> import asterism as am
        >>> am.RandomWalk(walk_sigma=2).process_noise([0.25])
        array([[[1.]]])
        """

    @abstractmethod
    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Return the covariance of one axis' state after the first detection, shape (n, n).

        Parameters
        ----------
        noise_sigma : float
            Standard deviation of a measured coordinate, metres.
        velocity_sigma : float
            Prior standard deviation of a velocity coordinate, m/s, used if the motion has no
            `velocity_sigma` of its own.

        Examples
        --------
        >>> import asterism as am
        >>> am.DWNA(acceleration_sigma=30).initial_covariance(noise_sigma=0.5, velocity_sigma=3)
        array([[0.25, 0.  ],
               [0.  , 9.  ]])
        """


def _steps(dt: ArrayLike) -> NDArray[np.float64]:
    return np.atleast_1d(np.asarray(dt, dtype=np.float64))


def _stack(rows: list[list[NDArray[np.float64]]]) -> NDArray[np.float64]:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@record
class DWNA(SingleMotion):
    """Discrete white noise acceleration: nearly constant velocity.

    The acceleration is constant within a step and independent from step to step:
    ``F = [1 Δ; 0 1]``, ``Q = σ_a² [Δ⁴/4 Δ³/2; Δ³/2 Δ²]``, ``H = [1 0]`` (Bar-Shalom, Li &
    Kirubarajan 2001, eq. 6.3.2-3; §5.6 of the report).

    Parameters
    ----------
    acceleration_sigma : float
        σ_a, standard deviation of an acceleration coordinate, m/s², > 0. Larger values widen the
        prediction and its gate.
    velocity_sigma : float, optional
        Prior standard deviation of a velocity coordinate, m/s, > 0. Without it, it follows from
        the population's `max_speed` (`TrackingModel.velocity_sigma`).

    Examples
    --------
    >>> import asterism as am
    >>> am.DWNA(acceleration_sigma=30).observation
    array([1., 0.])
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
        """Observation row ``H = [1 0]``."""
        return np.array([1.0, 0.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return F for each Δ of `dt` (M,), shape (M, 2, 2).

        Examples
        --------
        >>> import asterism as am
        >>> am.DWNA(acceleration_sigma=2).transition([0.5])[0]
        array([[1. , 0.5],
               [0. , 1. ]])
        """
        d = _steps(dt)
        F = np.zeros((*d.shape, 2, 2))
        F[..., 0, 0] = F[..., 1, 1] = 1.0
        F[..., 0, 1] = d
        return F

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return Q for each Δ of `dt` (M,), shape (M, 2, 2).

        Examples
        --------
        >>> import asterism as am
        >>> am.DWNA(acceleration_sigma=2).process_noise([1])[0]
        array([[1., 2.],
               [2., 4.]])
        """
        d = _steps(dt)
        Q = np.empty((*d.shape, 2, 2))
        Q[..., 0, 0] = d**4 / 4
        Q[..., 0, 1] = Q[..., 1, 0] = d**3 / 2
        Q[..., 1, 1] = d**2
        return self.acceleration_sigma**2 * Q

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Return ``diag(σ², σ_v²)``, shape (2, 2).

        Examples
        --------
        >>> import asterism as am
        >>> am.DWNA(acceleration_sigma=2).initial_covariance(noise_sigma=0.5, velocity_sigma=3)
        array([[0.25, 0.  ],
               [0.  , 9.  ]])
        """
        return np.diag([noise_sigma**2, (self.velocity_sigma or velocity_sigma) ** 2])


@record
class RandomWalk(SingleMotion):
    """Random walk of the position: one state, ``F = 1``, ``Q = σ_w² Δ``.

    Parameters
    ----------
    walk_sigma : float
        σ_w, standard deviation of a coordinate's change in one second, m/√s, > 0.

    Examples
    --------
    >>> import asterism as am
    >>> am.RandomWalk(walk_sigma=0.1).observation
    array([1.])
    """

    walk_sigma: float

    kind: ClassVar[str] = "random_walk"

    def __post_init__(self) -> None:
        check_number("walk_sigma", self.walk_sigma, above=0, below=1e12)

    @property
    def observation(self) -> NDArray[np.float64]:
        """Observation row ``H = [1]``."""
        return np.array([1.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return F = 1 for each Δ of `dt` (M,), shape (M, 1, 1).

        Examples
        --------
        >>> import asterism as am
        >>> am.RandomWalk(walk_sigma=2).transition([0.25])[0]
        array([[1.]])
        """
        return np.ones((len(_steps(dt)), 1, 1))

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return ``Q = σ_w² Δ`` for each Δ of `dt` (M,), shape (M, 1, 1).

        Examples
        --------
        >>> import asterism as am
        >>> am.RandomWalk(walk_sigma=2).process_noise([0.25, 0.5]).ravel()
        array([1., 2.])
        """
        return self.walk_sigma**2 * _steps(dt)[:, None, None]

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Return ``σ²``, shape (1, 1); the state has no velocity.

        Examples
        --------
        >>> import asterism as am
        >>> am.RandomWalk(walk_sigma=2).initial_covariance(noise_sigma=0.5, velocity_sigma=3)
        array([[0.25]])
        """
        return np.array([[noise_sigma**2]])


@record
class DWPA(SingleMotion):
    """Discrete Wiener process acceleration: nearly constant acceleration.

    ``F = [1 Δ Δ²/2; 0 1 Δ; 0 0 1]``, ``Q = σ_j² g gᵀ`` with ``g = (Δ²/2, Δ, 1)`` (Bar-Shalom, Li &
    Kirubarajan 2001, eq. 6.3.3-2).

    Parameters
    ----------
    increment_sigma : float
        σ_j, standard deviation of the change of acceleration in one step, m/s², > 0. Larger
        values widen the prediction and its gate.
    acceleration_prior_sigma : float
        σ_α, prior standard deviation of an acceleration coordinate, m/s², > 0.
    velocity_sigma : float, optional
        Prior standard deviation of a velocity coordinate, m/s, as in `DWNA`.

    Examples
    --------
    >>> import asterism as am
    >>> am.DWPA(increment_sigma=2, acceleration_prior_sigma=20).observation
    array([1., 0., 0.])
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
        """Observation row ``H = [1 0 0]``."""
        return np.array([1.0, 0.0, 0.0])

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return F for each Δ of `dt` (M,), shape (M, 3, 3).

        Examples
        --------
        >>> import asterism as am
        >>> am.DWPA(increment_sigma=2, acceleration_prior_sigma=20).transition([0.5])[0]
        array([[1.   , 0.5  , 0.125],
               [0.   , 1.   , 0.5  ],
               [0.   , 0.   , 1.   ]])
        """
        d = _steps(dt)
        one, zero = np.ones_like(d), np.zeros_like(d)
        return _stack([[one, d, d**2 / 2], [zero, one, d], [zero, zero, one]])

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return Q for each Δ of `dt` (M,), shape (M, 3, 3).

        Examples
        --------
        >>> import asterism as am
        >>> am.DWPA(increment_sigma=2, acceleration_prior_sigma=20).process_noise([1])[0]
        array([[1., 2., 2.],
               [2., 4., 4.],
               [2., 4., 4.]])
        """
        d = _steps(dt)
        g = np.stack([d**2 / 2, d, np.ones_like(d)], axis=-1)
        return self.increment_sigma**2 * g[:, :, None] * g[:, None, :]

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Return ``diag(σ², σ_v², σ_α²)``, shape (3, 3).

        Examples
        --------
        >>> import asterism as am
        >>> motion = am.DWPA(increment_sigma=2, acceleration_prior_sigma=20)
        >>> motion.initial_covariance(noise_sigma=0.5, velocity_sigma=3)
        array([[2.5e-01, 0.0e+00, 0.0e+00],
               [0.0e+00, 9.0e+00, 0.0e+00],
               [0.0e+00, 0.0e+00, 4.0e+02]])
        """
        return np.diag(
            [
                noise_sigma**2,
                (self.velocity_sigma or velocity_sigma) ** 2,
                self.acceleration_prior_sigma**2,
            ]
        )
