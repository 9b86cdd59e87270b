"""Projection of points: pixels, depths, and reasons why points are not seen."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Projection", "Reason"]


class Reason(IntEnum):
    """Reason why a camera does not see a point: the first one that applies, in this order."""

    VISIBLE = 0
    """The point is seen."""
    ABSENT = 1
    """The point is absent: a coordinate is NaN."""
    BEHIND = 2
    """Not in front of the camera."""
    NEAR = 3
    """Nearer than the camera's range."""
    FAR = 4
    """Farther than the camera's range."""
    LENS = 5
    """Beyond the domain of the lens model."""
    OUTSIDE = 6
    """Outside the image."""
    HIDDEN = 7
    """Behind a surface."""


@record(eq=False)
class Projection:
    """Points as cameras see them; all arrays have the shape of the points, cameras first for a rig.

    Parameters
    ----------
    pixels : ndarray, shape (..., 2)
        (u, v) from the centre of the top left pixel, u to the right, v down. Also of points beside
        the image or hidden; NaN where there is no image at all (absent, behind, beyond the lens).
    depth : ndarray, shape (...)
        Distance along the optical axis, metres.
    reason : ndarray of uint8, shape (...)
        Each a `Reason`.
    hidden_by : ndarray of int32, shape (...)
        Which surface hides the point: the one nearest to the camera; -1 if none.
    """

    pixels: NDArray[np.float64]
    depth: NDArray[np.float64]
    reason: NDArray[np.uint8]
    hidden_by: NDArray[np.int32]

    def __repr__(self) -> str:
        n = int(self.visible.sum())
        return f"Projection({n} of {self.visible.size} visible, shape {self.visible.shape})"

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Whether each point is seen."""
        return self.reason == Reason.VISIBLE

    def counts(self) -> dict[Reason, int]:
        """Return the number of points for each reason."""
        return {reason: int((self.reason == reason).sum()) for reason in Reason}

    def __getitem__(self, key: int) -> Projection:
        """One entry of the first axis: of a rig's projection, one camera's."""
        return Projection(
            pixels=self.pixels[key],
            depth=self.depth[key],
            reason=self.reason[key],
            hidden_by=self.hidden_by[key],
        )
