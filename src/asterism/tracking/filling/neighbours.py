"""The body beside a hidden marker: who keeps its distance, and how these neighbours moved.

Symbols: F frames, n neighbours, D axes, R turns the body's axes into the room's, c its middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Body", "fit_body"]

ROUNDS = 2
"""Times that the shape of the body is averaged anew; a third changes it by nothing to speak of."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """How a body stood in some frames.

    Parameters
    ----------
    turns : ndarray, shape (F, D, D)
        R.
    middles : ndarray, shape (F, D)
        c, metres.
    """

    turns: NDArray[np.float64]
    middles: NDArray[np.float64]

    def to_body(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Room to body, ``Rᵀ (x - c)``; `points` has shape (F, D) or (F, n, D)."""
        arms = points.reshape(len(points), -1, points.shape[-1]) - self.middles[:, None]
        return (arms @ self.turns).reshape(points.shape)

    def to_room(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Body to room, ``R x + c``; the inverse of `to_body`."""
        arms = points.reshape(len(points), -1, points.shape[-1])
        there = arms @ self.turns.swapaxes(1, 2) + self.middles[:, None]
        return there.reshape(points.shape)

    def of(self, frames: NDArray[np.int64]) -> Body:
        """Give the body of some of the frames, in any order."""
        return Body(turns=self.turns[frames], middles=self.middles[frames])


def fit_body(points: NDArray[np.float64], weights: NDArray[np.float64]) -> Body:
    """Fit a rigid body to its markers in every frame by weighted least squares.

    Its shape is the mean over the frames. With fewer than D markers it is moved and not turned.

    Parameters
    ----------
    points : ndarray, shape (F, n, D)
        All finite.
    weights : ndarray, shape (n,)

    References
    ----------
    Horn 1987, J. Opt. Soc. Am. A 4(4); by singular values as Kabsch 1976, Acta Cryst. A 32.
    """
    F, n, D = points.shape
    turns = np.broadcast_to(np.eye(D), (F, D, D))
    if n == 0:
        return Body(turns=turns, middles=np.zeros((F, D)))
    w = weights / weights.sum()
    middles = w @ points
    if n < D:
        return Body(turns=turns, middles=middles)
    arms = points - middles[:, None]
    shape = arms[F // 2]
    for i in range(ROUNDS + 1):
        # A few frames are enough for the shape; all are turned by it.
        chosen = arms[:: max(1, F // 200)] if i < ROUNDS else arms
        U, _, Vt = np.linalg.svd(chosen.swapaxes(1, 2) @ (w[:, None] * shape))
        flip = np.ones((len(chosen), D))
        flip[:, -1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))  # a body is never mirrored
        turns = (U * flip[:, None]) @ Vt
        if i < ROUNDS:
            shape = (chosen @ turns).mean(axis=0)
    return Body(turns=turns, middles=middles)
