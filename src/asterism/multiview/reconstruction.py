"""Reconstructed points with their image points, cameras and covariances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import keep_array
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from asterism.camera import Observations
    from asterism.model import Detections
    from asterism.multiview.image_model import ImageModel

__all__ = ["Reconstruction", "Views"]


@record(eq=False)
class Views:
    """Views of the reconstructed points: the image points from which each was triangulated.

    Parameters
    ----------
    offsets : array_like of int, shape (N + 1,)
        Point i was made of the views ``offsets[i]:offsets[i + 1]``.
    cameras : array_like of int, shape (V,)
        The camera of each view, as the observations number them; rising within a point.
    blobs : array_like of int, shape (V,)
        Its image point, a row of ``observations.pixels``.
    """

    offsets: NDArray[np.int64]
    cameras: NDArray[np.int64]
    blobs: NDArray[np.int64]

    def __repr__(self) -> str:
        return f"Views({len(self.counts)} points of {len(self.blobs)} views)"

    def __post_init__(self) -> None:
        offsets = keep_array("offsets", self.offsets, ("N + 1",), dtype=np.int64)
        blobs = keep_array("blobs", self.blobs, ("V",), dtype=np.int64)
        cameras = keep_array("cameras", self.cameras, (len(blobs),), dtype=np.int64)
        is_rising = len(offsets) and offsets[0] == 0 and (np.diff(offsets) >= 0).all()
        if not is_rising or offsets[-1] != len(blobs):
            raise ParameterError("offsets", f"a rising sequence from 0 to {len(blobs)}", "another")
        for name, array in (("offsets", offsets), ("cameras", cameras), ("blobs", blobs)):
            object.__setattr__(self, name, array)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of views of each point, shape (N,)."""
        return np.diff(self.offsets)

    @property
    def point_of(self) -> NDArray[np.int64]:
        """Point of each view, shape (V,)."""
        return np.repeat(np.arange(len(self.offsets) - 1), self.counts)

    @property
    def is_shared(self) -> NDArray[np.bool_]:
        """True for views whose image point belongs to another point too, shape (V,)."""
        if not len(self.blobs):
            return np.zeros(0, dtype=bool)
        first = int(self.blobs.min())
        return np.bincount(self.blobs - first)[self.blobs - first] > 1

    def of(self, point: int) -> list[tuple[int, int]]:
        """Return (camera, image point) of each view of a point."""
        rows = slice(int(self.offsets[point]), int(self.offsets[point + 1]))
        return list(zip(self.cameras[rows].tolist(), self.blobs[rows].tolist(), strict=True))


@record(eq=False)
class Reconstruction:
    """Result of `reconstruct`: points, their views, and the image model.

    Attributes
    ----------
    detections : Detections
        The points in space, with their cameras (by number in the rig), residuals (root mean square
        distance of the rays), covariances, and from these the standard deviation of a coordinate.
    views : Views
        The image points that made each.
    scores : ndarray, shape (N,)
        Log likelihood ratio of each point against its image points being clutter.
    model : ImageModel
        What the images were taken to be like.
    info : mapping
        ``n_candidates``: how many sets of image points were weighed; ``n_searched``: in how many
        groups the best choice among them had to be searched; ``n_cut``: in how many of those the
        search was cut; ``gap``: by how much in all the best choice may be better, nats.
    """

    detections: Detections
    views: Views
    scores: NDArray[np.float64]
    model: ImageModel
    info: Mapping[str, float]

    def __repr__(self) -> str:
        return f"Reconstruction({self.detections.summary()}, of {len(self.views.blobs)} views)"

    def markers(self, observations: Observations) -> NDArray[np.int64]:
        """Return the true marker of each point from the true labels of the image points.

        Parameters
        ----------
        observations : Observations
            What was reconstructed.

        Returns
        -------
        ndarray of int, shape (N,)
            The marker of most of its image points (of several the first), -1 if most are of none.

        Raises
        ------
        ParameterError
            If they do not know the truth.
        """
        if observations.markers is None:
            raise ParameterError("observations", "the truth (markers)", "none")
        of = observations.markers[self.views.blobs]
        pair, votes = np.unique(
            np.stack([self.views.point_of, of], axis=1), axis=0, return_counts=True
        )
        order = np.lexsort((pair[:, 1], -votes, pair[:, 0]))
        first = order[np.unique(pair[order, 0], return_index=True)[1]] if len(order) else order
        return pair[first, 1]
