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
        Point i was triangulated from the views ``offsets[i]:offsets[i + 1]``.
    cameras : array_like of int, shape (V,)
        Camera of each view, numbered as in the observations; ascending within a point.
    blobs : array_like of int, shape (V,)
        Image point of each view, a row of ``observations.pixels``.

    Raises
    ------
    ParameterError
        If an array does not fit the others.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> film = am.simulate.film(am.simulate.cube(seed=1, frames=10), rig)
    >>> views = am.reconstruct(film.observations, rig).views
    >>> views
    Views(80 points of 320 views)
    >>> int(views.counts.min()), int(views.is_shared.sum())
    (4, 0)
    >>> camera, image_point = views.of(0)[0]
    >>> int(views.point_of[0]), camera, image_point
    (0, 0, 0)
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
            raise ParameterError(
                "offsets", f"a rising sequence from 0 to {len(blobs)}", "another sequence"
            )
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
        """Return the views of a point.

        Parameters
        ----------
        point : int
            Number of the point.

        Returns
        -------
        list of (int, int)
            Camera and image point of each view.
        """
        rows = slice(int(self.offsets[point]), int(self.offsets[point + 1]))
        return list(zip(self.cameras[rows].tolist(), self.blobs[rows].tolist(), strict=True))


@record(eq=False)
class Reconstruction:
    """Result of `reconstruct`: points, their views, and the image model.

    Attributes
    ----------
    detections : Detections
        Points in space, with their cameras (by number in the rig), residuals (root mean square
        distance from the rays, metres), covariances, and standard deviations of a coordinate.
    views : Views
        Image points of each point.
    scores : ndarray of shape (N,)
        Log-likelihood ratio of each point against clutter, nats.
    model : ImageModel
        Image model that was used.
    info : mapping
        ``n_candidates``: number of candidate sets of image points; ``n_searched``: number of groups
        of candidates that needed a search; ``n_cut``: number of these in which the search was
        stopped at `max_nodes`; ``gap``: bound of the total loss against the optimum, nats.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> film = am.simulate.film(am.simulate.cube(seed=1, frames=10), rig)
    >>> found = am.reconstruct(film.observations, rig)
    >>> found
    Reconstruction(10 frames, 80 points, 3-D, 0 to 9 s, of 320 views)
    >>> found.markers(film.observations)[:8].tolist(), found.info["n_cut"]
    ([0, 3, 1, 2, 4, 6, 5, 7], 0)
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
            Observations that were reconstructed, with the true marker of each image point.

        Returns
        -------
        ndarray of int, shape (N,)
            Marker of most of the point's image points (the lowest number in a tie), -1 for clutter.

        Raises
        ------
        ParameterError
            If the observations have no true markers.
        """
        if observations.markers is None:
            raise ParameterError("observations", "the true markers of the image points", "none")
        of = observations.markers[self.views.blobs]
        pair, votes = np.unique(
            np.stack([self.views.point_of, of], axis=1), axis=0, return_counts=True
        )
        order = np.lexsort((pair[:, 1], -votes, pair[:, 0]))
        first = order[np.unique(pair[order, 0], return_index=True)[1]] if len(order) else order
        return pair[first, 1]
