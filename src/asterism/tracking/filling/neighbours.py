"""Rigid body of an occluded marker, fitted to its neighbours in every frame.

Symbols: F frames, n neighbours, D axes, R rotation from body to room axes, c centre of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism._engine import turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Body", "fit_body"]

ROUNDS = 2
"""Number of times that the shape of the body is averaged; a third round has no visible effect."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """Pose of a body in each of F frames.

    Parameters
    ----------
    turns : ndarray of shape (F, D, D)
        Rotations R.
    middles : ndarray of shape (F, D)
        Centres c, metres.
    """

    turns: NDArray[np.float64]
    middles: NDArray[np.float64]

    def to_body(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points from room to body coordinates, ``Rᵀ (x - c)``.

        Parameters
        ----------
        points : ndarray of shape (F, D) or (F, n, D)
            Points in room coordinates, metres.

        Returns
        -------
        ndarray, of the same shape
        """
        arms = points.reshape(len(points), -1, points.shape[-1]) - self.middles[:, None]
        return (arms @ self.turns).reshape(points.shape)

    def to_room(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points from body to room coordinates, ``R x + c``.

        Parameters
        ----------
        points : ndarray of shape (F, D) or (F, n, D)
            Points in body coordinates, metres.

        Returns
        -------
        ndarray, of the same shape
        """
        arms = points.reshape(len(points), -1, points.shape[-1])
        there = arms @ self.turns.swapaxes(1, 2) + self.middles[:, None]
        return there.reshape(points.shape)

    def of(self, frames: NDArray[np.int64]) -> Body:
        """Return the poses of some of the frames, in any order.

        Parameters
        ----------
        frames : ndarray of int, shape (f,)
            Frames to select; a frame may occur several times.

        Returns
        -------
        Body
        """
        return Body(turns=self.turns[frames], middles=self.middles[frames])


def fit_body(points: NDArray[np.float64], weights: NDArray[np.float64]) -> Body:
    """Fit a rigid body to its markers in every frame by weighted least squares.

    The shape is the mean over the frames. With fewer than D markers the body is translated only.

    Parameters
    ----------
    points : ndarray of shape (F, n, D)
        Positions of the markers, metres, all finite.
    weights : ndarray of shape (n,)
        Weight of each marker in the fit, > 0.

    Returns
    -------
    Body

    References
    ----------
    Horn 1987, J. Opt. Soc. Am. A 4(4).
    """
    F, n, D = points.shape
    still = np.broadcast_to(np.eye(D), (F, D, D))
    if n == 0:
        return Body(turns=still, middles=np.zeros((F, D)))
    w = weights / weights.sum()
    middles = w @ points
    if n < D:
        return Body(turns=still, middles=middles)
    arms = points - middles[:, None]
    shape = arms[F // 2]
    some = arms[:: max(1, F // 200)]  # a few frames are enough for the shape
    for _ in range(ROUNDS):
        shape = (some @ turns(shape, some.reshape(-1, D), w)).mean(axis=0)
    return Body(turns=turns(shape, arms.reshape(-1, D), w), middles=middles)
