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
    """Reason why a camera does not see a point: the first one that applies, in this order.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=4, height=2)
    >>> behind = rig[0].project([9.0, 0.0, 2.0])
    >>> am.camera.Reason(int(behind.reason)).name
    'BEHIND'
    """

    VISIBLE = 0
    """The point is seen."""
    ABSENT = 1
    """The point is absent: a coordinate is NaN."""
    BEHIND = 2
    """The point is not in front of the camera."""
    NEAR = 3
    """The point is nearer than the camera's range."""
    FAR = 4
    """The point is farther than the camera's range."""
    LENS = 5
    """The point is beyond the domain of the lens model."""
    OUTSIDE = 6
    """The point is outside the image."""
    OCCLUDED = 7
    """The point is occluded by a surface."""


@record(eq=False)
class Projection:
    """Image points and visibility of projected points.

    All arrays have the shape of the points, with a leading axis of cameras for a rig.

    Parameters
    ----------
    pixels : ndarray of shape (..., 2)
        (u, v) from the centre of the top left pixel, u to the right, v down. Points outside the
        image and occluded points have pixels too; absent points, points behind the camera and
        points beyond the lens have NaN.
    depth : ndarray of shape (...)
        Distance along the optical axis, metres.
    reason : ndarray of uint8, shape (...)
        `Reason` of each point.
    occluded_by : ndarray of int32, shape (...)
        Number of the occluding surface nearest to the camera, -1 without one.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=4, height=2)
    >>> seen = rig.project([[0, 0, 1], [0, 9, 1]])
    >>> seen
    Projection(2 of 4 visible, shape (2, 2))
    >>> seen.visible
    array([[ True, False],
           [ True, False]])
    >>> {reason.name: n for reason, n in seen.counts().items() if n}
    {'VISIBLE': 2, 'OUTSIDE': 2}
    """

    pixels: NDArray[np.float64]
    depth: NDArray[np.float64]
    reason: NDArray[np.uint8]
    occluded_by: NDArray[np.int32]

    def __repr__(self) -> str:
        n = int(self.visible.sum())
        return f"Projection({n} of {self.visible.size} visible, shape {self.visible.shape})"

    @property
    def visible(self) -> NDArray[np.bool_]:
        """True for points that are seen, shape (...)."""
        return self.reason == Reason.VISIBLE

    def counts(self) -> dict[Reason, int]:
        """Return the number of points for each reason."""
        return {reason: int((self.reason == reason).sum()) for reason in Reason}

    def __getitem__(self, key: int) -> Projection:
        """Return one entry of the first axis, for a rig the projection of one camera."""
        return Projection(
            pixels=self.pixels[key],
            depth=self.depth[key],
            reason=self.reason[key],
            occluded_by=self.occluded_by[key],
        )
