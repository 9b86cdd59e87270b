"""Truth through a rig: what each camera sees of it, and who is who."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.camera import Projection, Rig, Surface
    from asterism.model import Tracks

__all__ = ["Film", "film"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Film:
    """What a rig makes of moving markers.

    Parameters
    ----------
    observations : Observations
        The image points that are seen, with the truth of which marker each is.
    projection : Projection
        Every marker in every image, seen or not and why: arrays of shape (C, T, K).
    """

    observations: Observations
    projection: Projection


def film(truth: Tracks, rig: Rig, surfaces: Sequence[Surface] = ()) -> Film:
    """Film markers with ideal cameras: no noise, every visible point is one image point.

    Parameters
    ----------
    truth : Tracks
        3-D, metres. Where a marker has no detection, no camera sees it; clutter is not filmed.
    rig : Rig
        The cameras.
    surfaces : sequence of Surface
        What hides markers; one moment, or one for every frame.

    Returns
    -------
    Film
        The points of a camera in a frame are in the order of the markers.

    Raises
    ------
    ParameterError
        If the truth is not 3-D, or a moving surface has another number of moments.

    Examples
    --------
    >>> import asterism as am
    >>> scene = am.simulate.cube(seed=1, frames=10)
    >>> film(scene, am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))).observations
    Observations(4 cameras, 10 frames, 320 points)
    """
    detections = truth.detections
    if detections.n_axes != 3:
        raise ParameterError("truth", "3-D detections", f"{detections.n_axes}-D ones")
    projection = rig.project(truth.positions(), surfaces)
    is_seen = np.swapaxes(projection.visible, 0, 1)  # frames, cameras, markers
    counts = is_seen.sum(axis=2).ravel()
    observations = Observations(
        times=detections.times,
        cameras=rig.names,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=np.swapaxes(projection.pixels, 0, 1)[is_seen],
        markers=np.nonzero(is_seen)[2].astype(np.int64),
        marker_names=tuple(
            name if name is not None else str(k) for k, name in enumerate(truth.names)
        ),
    )
    return Film(observations=observations, projection=projection)
