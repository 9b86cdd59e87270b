"""Filming of a scene by a rig: image points of each camera, with their true markers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations, Rig
from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.records import record
from asterism.simulate.centroids import Blobs, Seeing, see
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.camera import Projection, Surface

__all__ = ["Film", "film"]


@record(eq=False)
class Film:
    """Filming of moving markers by a rig: image points of every camera.

    Parameters
    ----------
    observations : Observations
        Image points, with the true marker of each (the largest one of a merged point).
    projection : Projection
        Projection and visibility of every marker in every image: arrays of shape (C, T, K).
    blob_of : ndarray of int, shape (C, T, K)
        Image point of each marker, -1 without one; merged markers share one.
    share : ndarray of shape (C, T, K)
        Visible share of each marker's disc, in [0, 1].

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> film = am.simulate.film(am.simulate.cube(seed=1, frames=10), rig)
    >>> film
    Film(4 cameras, 10 frames, 8 markers, 320 image points)
    >>> float(film.projection.visible.mean()), film.blob_of.shape
    (1.0, (4, 10, 8))
    """

    observations: Observations
    projection: Projection
    blob_of: NDArray[np.int64]
    share: NDArray[np.float64]

    def __repr__(self) -> str:
        seen = self.observations
        return (
            f"Film({seen.n_cameras} cameras, {seen.n_frames} frames, "
            f"{self.blob_of.shape[-1]} markers, {seen.n_points} image points)"
        )


def film(
    truth: Tracks,
    rig: Rig,
    surfaces: Sequence[Surface] | None = None,
    *,
    seeing: Seeing | None = None,
    seed: int = 0,
) -> Film:
    """Film the markers of a scene by a rig.

    Parameters
    ----------
    truth : Tracks
        Markers in 3-D. A marker without a detection is seen by no camera; clutter is not filmed.
    rig : Rig
        Cameras that film.
    surfaces : sequence of Surface, optional
        Surfaces that occlude markers, each fixed or with one moment per frame. By default those of
        the scene.
    seeing : Seeing, optional
        Image formation: partial occlusion, merging, noise, missed detections and false alarms. By
        default every visible marker has one exact image point, in the order of the markers.
    seed : int
        Seed of all random numbers.

    Returns
    -------
    Film
        Image points, with the truth.

    Raises
    ------
    ParameterError
        If the truth is not 3-D, or a moving surface has another number of moments.

    Examples
    --------
    >>> import asterism as am
    >>> scene = am.simulate.cube(seed=1, frames=10)
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> film(scene, rig).observations
    Observations(4 cameras, 10 frames, 320 points)
    >>> film(scene, rig, seeing=am.simulate.Seeing(missing=0.1), seed=1).observations
    Observations(4 cameras, 10 frames, 293 points)
    """
    check_kind("truth", truth, Tracks)
    check_kind("rig", rig, Rig, "am.read_rig(path)")
    detections = truth.detections
    if detections.n_axes != 3:
        raise ParameterError("truth", "3-D detections", f"{detections.n_axes}-D detections")
    check_number("seed", seed, above=0, closed=True, integer=True)
    if seeing is not None:
        check_kind("seeing", seeing, Seeing)
    if surfaces is None:
        surfaces = truth.surfaces if isinstance(truth, Truth) else ()
    positions = truth.positions()
    projection = rig.project(positions, surfaces)
    if seeing is None:
        blobs = _ideal(projection)
    else:
        blobs = see(detections.times, positions, rig, surfaces, seeing, int(seed))
    counts = np.bincount(blobs.cell, minlength=detections.n_frames * len(rig))
    observations = Observations(
        times=detections.times,
        cameras=rig.names,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=blobs.pixels,
        markers=blobs.markers,
        marker_names=tuple(
            name if name is not None else str(k) for k, name in enumerate(truth.names)
        ),
    )
    return Film(
        observations=observations,
        projection=projection,
        blob_of=blobs.blob_of,
        share=blobs.share,
    )


def _ideal(projection: Projection) -> Blobs:
    is_seen = np.swapaxes(projection.visible, 0, 1)  # frames, cameras, markers
    frames, cameras, markers = np.nonzero(is_seen)
    blob_of = np.full(is_seen.shape, -1)
    blob_of[is_seen] = np.arange(len(frames))
    return Blobs(
        frames * is_seen.shape[1] + cameras,
        np.swapaxes(projection.pixels, 0, 1)[is_seen],
        markers,
        np.ascontiguousarray(np.swapaxes(blob_of, 0, 1)),
        projection.visible.astype(np.float64),
    )
