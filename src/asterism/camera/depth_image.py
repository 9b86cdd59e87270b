"""Depth image: depth and surface of every pixel, by the z-buffer of the 2010 report (§3.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera.projection import Reason
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera.projection import Projection

__all__ = ["DepthImage"]


@record(eq=False)
class DepthImage:
    """Depth and surface at the centre of every pixel.

    Parameters
    ----------
    depth : ndarray, shape (height, width)
        Along the optical axis, metres; infinite where no surface is seen.
    surface : ndarray of int32, shape (height, width)
        Which surface is seen there, -1 where none is.
    """

    depth: NDArray[np.float64]
    surface: NDArray[np.int32]

    def hides(self, projection: Projection, clearance: float = 1e-6) -> NDArray[np.bool_]:
        """Find the points that lie behind the surface of their nearest pixel.

        The answer of a z-buffer: as fine as the pixels, so at the edges of a surface it may differ
        from the exact test of `Camera.project`.

        Parameters
        ----------
        projection : Projection
            Of points by the same camera.
        clearance : float
            Metres of depth that a point may lie behind a surface and still be seen.

        Returns
        -------
        ndarray of bool, shape (...)
            False for points that fall beside the image.
        """
        in_image = np.isin(projection.reason, (Reason.VISIBLE, Reason.HIDDEN))
        h, w = self.depth.shape
        u, v = np.where(in_image[..., None], np.rint(np.nan_to_num(projection.pixels)), 0.0).T
        i = np.clip(v.T.astype(np.int64), 0, h - 1), np.clip(u.T.astype(np.int64), 0, w - 1)
        return in_image & (self.depth[i] < projection.depth - clearance)
