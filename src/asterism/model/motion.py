"""How a marker moves: linear motion models, the same on every axis.

With isotropic noise the axes do not mix, so a model speaks of one axis: ``n`` states, a transition
F, a process noise Q and an observation H. Symbols: Δ time from frame to frame in seconds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from asterism.errors import ParameterError, check_array, check_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "DWNA",
    "DWPA",
    "MOTIONS",
    "InteractingMotions",
    "LinearMotion",
    "Motion",
    "RandomWalk",
    "SingleMotion",
]


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


@dataclass(frozen=True, kw_only=True)
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
        check_number("acceleration_sigma", self.acceleration_sigma, above=0)
        if self.velocity_sigma is not None:
            check_number("velocity_sigma", self.velocity_sigma, above=0)

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


@dataclass(frozen=True, kw_only=True)
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
        check_number("walk_sigma", self.walk_sigma, above=0)

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


@dataclass(frozen=True, kw_only=True)
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
        check_number("increment_sigma", self.increment_sigma, above=0)
        check_number("acceleration_prior_sigma", self.acceleration_prior_sigma, above=0)
        if self.velocity_sigma is not None:
            check_number("velocity_sigma", self.velocity_sigma, above=0)

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


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearMotion(SingleMotion):
    """Any linear model of one axis, by its matrices for one step.

    A step of ``k`` times `step` applies F ``k`` times; a spacing that is no multiple (within 2 %)
    is refused, because the matrices do not say what happens in between.

    Parameters
    ----------
    F, Q : array_like, shape (n, n)
        Transition and process noise over `step`; n is 1, 2 or 3.
    H : array_like, shape (n,)
        Observation: position = H · state.
    step : float
        The spacing, seconds, for which F and Q hold.
    prior_covariance : array_like, shape (n, n)
        Covariance of the state when a track begins, given its position; the measurement noise is
        added along H.
    """

    F: NDArray[np.float64]
    Q: NDArray[np.float64]
    H: NDArray[np.float64]
    step: float
    prior_covariance: NDArray[np.float64]

    kind: ClassVar[str] = "linear"

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.H))
        if n not in (1, 2, 3):
            raise ParameterError("H", "1 to 3 states an axis", n)
        object.__setattr__(self, "H", check_array("H", self.H, (n,)))
        for name in ("F", "Q", "prior_covariance"):
            object.__setattr__(self, name, check_array(name, getattr(self, name), (n, n)))
        check_number("step", self.step, above=0)
        if not self.H.any():
            raise ParameterError("H", "a row that sees the state", self.H)
        for name in ("Q", "prior_covariance"):
            matrix = getattr(self, name)
            scale = np.abs(matrix).max() + 1e-300
            if not np.allclose(matrix, matrix.T, rtol=0, atol=1e-12 * scale):
                raise ParameterError(name, "a symmetric matrix", matrix.tolist())
            if np.linalg.eigvalsh(matrix).min() < -1e-10 * scale:
                raise ParameterError(name, "a positive semi-definite matrix", matrix.tolist())

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, LinearMotion)
            and self.step == other.step
            and all(
                np.array_equal(getattr(self, name), getattr(other, name))
                for name in ("F", "Q", "H", "prior_covariance")
            )
        )

    def __hash__(self) -> int:
        return hash((self.step, self.F.tobytes(), self.Q.tobytes(), self.H.tobytes()))

    @property
    def observation(self) -> NDArray[np.float64]:
        """The given H."""
        return self.H

    def _powers(self, dt: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        d = _steps(dt)
        k = np.rint(d / self.step).astype(np.int64)
        off = np.flatnonzero((np.abs(d - k * self.step) > 0.02 * self.step) | (k < 1))
        if len(off):
            raise ParameterError(
                "times",
                f"a spacing that is a multiple of the motion model's step of {self.step:g} s",
                f"{d[off[0]]:g} s",
                "give F and Q for the capture's own spacing",
            )
        return k, d

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """F to the power Δ / step for each Δ of `dt` (M,), shape (M, n, n)."""
        k, _ = self._powers(dt)
        unique, inverse = np.unique(k, return_inverse=True)
        return np.stack([np.linalg.matrix_power(self.F, int(p)) for p in unique])[inverse]

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Q accumulated over Δ / step steps for each Δ of `dt` (M,), shape (M, n, n)."""
        k, _ = self._powers(dt)
        unique, inverse = np.unique(k, return_inverse=True)
        table: list[NDArray[np.float64]] = []
        total, done = np.zeros_like(self.Q), 0
        for p in unique:
            for _ in range(int(p) - done):
                total = self.F @ total @ self.F.T + self.Q
            done = int(p)
            table.append(total)
        return np.stack(table)[inverse]

    def initial_covariance(self, noise_sigma: float, velocity_sigma: float) -> NDArray[np.float64]:
        """Prior covariance plus the measurement noise along H, shape (n, n)."""
        along = self.H / (self.H @ self.H)
        return self.prior_covariance + noise_sigma**2 * np.outer(along, along)


@dataclass(frozen=True, kw_only=True, eq=False)
class InteractingMotions(Motion):
    """A marker that changes between motions: at rest, moving, thrown.

    The filter keeps a state for each and mixes them (interacting multiple model, Blom &
    Bar-Shalom 1988); a detection is weighed against the mixture of their predictions, which is an
    approximation of the exact sum over all sequences of modes.

    Parameters
    ----------
    models : sequence of 2 or 3 motions
        Single ones of one kind, differing in their noise. The prior of the first holds for new
        tracks.
    transitions : array_like, shape (M, M)
        Probability of going from mode (row) to mode (column) in a step; positive, rows sum to 1.
    """

    models: tuple[SingleMotion, ...]
    transitions: NDArray[np.float64]

    kind: ClassVar[str] = "interacting"

    def __post_init__(self) -> None:
        models = tuple(self.models)
        M = len(models)
        if M not in (2, 3):
            raise ParameterError("models", "2 or 3 motion models", M)
        kinds = [model.kind for model in models]
        if len(set(kinds)) > 1 or InteractingMotions.kind in kinds:
            raise ParameterError("models", "single motions of one kind", kinds)
        observations = np.stack([model.observation for model in models])
        if not (observations == observations[0]).all():
            raise ParameterError("models", "motions with the same H", observations.tolist())
        transitions = check_array("transitions", self.transitions, (M, M))
        if (transitions <= 0).any() or not np.allclose(transitions.sum(axis=1), 1, atol=1e-9):
            raise ParameterError("transitions", "positive rows that sum to 1", transitions.tolist())
        object.__setattr__(self, "models", models)
        object.__setattr__(self, "transitions", transitions)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, InteractingMotions)
            and self.models == other.models
            and np.array_equal(self.transitions, other.transitions)
        )

    def __hash__(self) -> int:
        return hash((self.models, self.transitions.tobytes()))

    @property
    def modes(self) -> tuple[SingleMotion, ...]:
        """The models."""
        return self.models

    @property
    def mode_transitions(self) -> NDArray[np.float64]:
        """Probability of going from mode to mode in a step, shape (M, M)."""
        return self.transitions


MOTIONS: dict[str, type[Motion]] = {
    model.kind: model for model in (DWNA, RandomWalk, DWPA, LinearMotion, InteractingMotions)
}
"""Every motion model by its name in a model file."""
