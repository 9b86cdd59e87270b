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
    depth : ndarray of shape (height, width)
        Depth along the optical axis, metres; infinite where no surface is seen.
    surface : ndarray of int32, shape (height, width)
        Number of the surface that is seen, -1 where none is.

    Examples
    --------
    >>> import asterism as am
    >>> K = am.camera.intrinsics(focal_length=40, principal_point=(31.5, 23.5))
    >>> camera = am.Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=(64, 48))
    >>> arm = am.camera.Capsule(ends=[[-0.5, 0, 1], [0.5, 0, 1]], radius=0.1)
    >>> image = camera.depth_image([arm])
    >>> round(float(image.depth[24, 32]), 2), int((image.surface == 0).sum())
    (3.91, 24)
    >>> image.hides(camera.project([[0, 1, 1], [0, -1, 1]]))  # behind the arm, and in front
    array([ True, False])
    """

    depth: NDArray[np.float64]
    surface: NDArray[np.int32]

    def hides(self, projection: Projection, clearance: float = 1e-6) -> NDArray[np.bool_]:
        """Find the points that lie behind the surface of their nearest pixel.

        The test of a z-buffer has the resolution of the pixels: at the edges of a surface it may
        differ from the exact test of `Camera.project`.

        Parameters
        ----------
        projection : Projection
            Projection of the points by the same camera.
        clearance : float
            Largest depth of a visible point behind the surface, metres; it allows for rounding.

        Returns
        -------
        ndarray of bool, shape (...)
            True for occluded points; False for points outside the image.
        """
        in_image = np.isin(projection.reason, (Reason.VISIBLE, Reason.OCCLUDED))
        h, w = self.depth.shape
        u, v = np.where(in_image[..., None], np.rint(np.nan_to_num(projection.pixels)), 0.0).T
        i = np.clip(v.T.astype(np.int64), 0, h - 1), np.clip(u.T.astype(np.int64), 0, w - 1)
        return in_image & (self.depth[i] < projection.depth - clearance)
