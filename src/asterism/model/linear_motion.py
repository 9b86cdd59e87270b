"""Linear motion of one axis, given by its matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from asterism.checks import check_number, keep_array
from asterism.errors import ParameterError
from asterism.model.motion import SingleMotion
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["LinearMotion"]

MAX_STEPS = 100_000


@record(eq=False)
class LinearMotion(SingleMotion):
    """Linear motion of one axis, given by its matrices for one step.

    Over ``k`` times `step` seconds F is applied ``k`` times. A spacing that is not a multiple of
    `step` within 2 % is refused, because the matrices do not define fractions of a step.

    Parameters
    ----------
    F, Q : array_like of shape (n, n)
        Transition and process noise over `step` seconds; n is 1, 2 or 3.
    H : array_like of shape (n,)
        Observation row: position = H · state.
    step : float
        Duration for which F and Q hold, seconds, > 0.
    prior_covariance : array_like of shape (n, n)
        Covariance of the state at the start of a track, given its position. The measurement noise
        is added along H.

    Examples
    --------
    >>> from asterism.model import LinearMotion
    >>> motion = LinearMotion(
    ...     F=[[1, 0.01], [0, 1]], Q=[[0, 0], [0, 0.04]], H=[1, 0], step=0.01,
    ...     prior_covariance=[[0, 0], [0, 4]],
    ... )
    >>> motion.transition([0.02])[0]
    array([[1.  , 0.02],
           [0.  , 1.  ]])
    >>> motion.observation
    array([1., 0.])
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
        object.__setattr__(self, "H", keep_array("H", self.H, (n,)))
        for name in ("F", "Q", "prior_covariance"):
            object.__setattr__(self, name, keep_array(name, getattr(self, name), (n, n)))
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
        """Observation row H, shape (n,)."""
        return self.H

    def _powers(self, dt: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        d = np.atleast_1d(np.asarray(dt, dtype=np.float64))
        k = np.rint(d / self.step).astype(np.int64)
        off = np.flatnonzero(
            (np.abs(d - k * self.step) > 0.02 * self.step) | (k < 1) | (k > MAX_STEPS)
        )
        if len(off):
            raise ParameterError(
                "times",
                f"a spacing of 1 to {MAX_STEPS} times the motion model's step of {self.step:g} s",
                f"{d[off[0]]:g} s",
                "give F and Q for the capture's own spacing",
            )
        return k, d

    def transition(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return F to the power Δ / step for each Δ of `dt` (M,), shape (M, n, n).

        Examples
        --------
        >>> motion = LinearMotion(F=[[0.5]], Q=[[1]], H=[1], step=0.01, prior_covariance=[[1]])
        >>> motion.transition([0.01, 0.02]).ravel()
        array([0.5 , 0.25])
        """
        k, _ = self._powers(dt)
        unique, inverse = np.unique(k, return_inverse=True)
        return np.stack([np.linalg.matrix_power(self.F, int(p)) for p in unique])[inverse]

    def process_noise(self, dt: ArrayLike) -> NDArray[np.float64]:
        """Return Q accumulated over Δ / step steps for each Δ of `dt` (M,), shape (M, n, n).

        Examples
        --------
        >>> motion = LinearMotion(F=[[0.5]], Q=[[1]], H=[1], step=0.01, prior_covariance=[[1]])
        >>> motion.process_noise([0.01, 0.02]).ravel()
        array([1.  , 1.25])
        """
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
        """Return the prior covariance plus the measurement noise along H, shape (n, n).

        Examples
        --------
        >>> motion = LinearMotion(F=[[0.5]], Q=[[1]], H=[1], step=0.01, prior_covariance=[[1]])
        >>> motion.initial_covariance(noise_sigma=0.5, velocity_sigma=1)
        array([[1.25]])
        """
        along = self.H / (self.H @ self.H)
        return self.prior_covariance + noise_sigma**2 * np.outer(along, along)
