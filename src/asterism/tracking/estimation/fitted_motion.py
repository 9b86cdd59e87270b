"""Motion and noise as the fit varies them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from asterism.model import DWNA, InteractingMotions, Motion, RandomWalk
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Kind", "MotionFit", "transition_matrices"]

Kind = Literal["dwna", "random_walk"]
JOLT = 0.1
"""Share of jolts among the transitions from quiet or busy; a jolt lasts two frames on average."""


@record
class MotionFit:
    """Fitted motion and noise.

    Parameters
    ----------
    noise : float
        σ, standard deviation of a measured coordinate, metres.
    levels : tuple of float
        Strength of each mode. DWNA: σ_a, m/s², of one mode or increasing of three (quiet, busy,
        jolt). Random walk: σ_w, m/√s, of one mode.
    stay : float
        Probability that a marker stays quiet, or busy, for another frame; 1 for one mode.
    kind : {"dwna", "random_walk"}
        Class of the motion.
    """

    noise: float
    levels: tuple[float, ...]
    stay: float = 1.0
    kind: Kind = "dwna"

    @property
    def transitions(self) -> NDArray[np.float64]:
        """Probability of switching from mode (row) to mode (column) in a step."""
        return transition_matrices(len(self.levels), np.array([self.stay]))[0]

    def motion(self, velocity_sigma: float) -> Motion:
        """Return the motion model.

        Parameters
        ----------
        velocity_sigma : float
            Prior standard deviation of a velocity coordinate, m/s.

        Returns
        -------
        Motion
        """
        if self.kind == "random_walk":
            return RandomWalk(walk_sigma=self.levels[0])
        models = tuple(
            DWNA(acceleration_sigma=a, velocity_sigma=velocity_sigma) for a in self.levels
        )
        if len(models) == 1:
            return models[0]
        return InteractingMotions(models=models, transitions=self.transitions)


def transition_matrices(n_modes: int, stays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the transition probabilities of several motions at once.

    Parameters
    ----------
    n_modes : int
        Number of modes, 1 or 3.
    stays : ndarray of shape (n,)
        `MotionFit.stay` of each motion.

    Returns
    -------
    ndarray of shape (n, modes, modes)
    """
    if n_modes == 1:
        return np.ones((len(stays), 1, 1))
    leave = 1 - stays
    matrices = np.empty((len(stays), 3, 3))
    matrices[:, 0, 0] = matrices[:, 1, 1] = stays
    matrices[:, 0, 1] = matrices[:, 1, 0] = (1 - JOLT) * leave
    matrices[:, 0, 2] = matrices[:, 1, 2] = JOLT * leave
    matrices[:, 2] = 0.25, 0.25, 0.5
    return matrices
