"""Density of clutter near markers, where ghosts are."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asterism.model import TrackingModel, Tracks

__all__ = ["with_clutter_near_markers"]

NEAR = 0.05
"""Distance from a detection of a track within which others without one are counted, metres."""
MAX_FRAMES = 400
"""Number of frames in which they are counted, spread over the capture."""


def with_clutter_near_markers(model: TrackingModel, tracks: Tracks) -> TrackingModel:
    """Return a model whose clutter is at least as dense as that near the markers of tracks.

    The estimated density is that of the whole volume. Ghosts are near markers, where they are
    mistaken for them.

    Parameters
    ----------
    model : TrackingModel
        Model of the capture.
    tracks : Tracks
        Tracks of its markers.

    Returns
    -------
    TrackingModel

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> ghosts = am.simulate.corrupt(truth, ghosts=am.simulate.Ghosts(), seed=1)
    >>> model = am.estimate_model(ghosts.detections).model
    >>> near = with_clutter_near_markers(model, ghosts)
    >>> near.sensor.clutter_density > 10 * model.sensor.clutter_density
    True
    """
    d, n, n_near = tracks.detections, 0, 0
    for t in range(0, d.n_frames, max(-(-d.n_frames // MAX_FRAMES), 1)):
        inside = slice(d.offsets[t], d.offsets[t + 1])
        y, is_own = d.points[inside], tracks.labels[inside] >= 0
        off = y[~is_own, None] - y[None, is_own]
        n_near += int(((off**2).sum(axis=2) <= NEAR**2).sum())
        n += int(is_own.sum())
    ball = math.pi ** (d.n_axes / 2) / math.gamma(d.n_axes / 2 + 1) * NEAR**d.n_axes
    density = max(model.sensor.clutter_density, n_near / max(n, 1) / ball)
    return dataclasses.replace(
        model, sensor=dataclasses.replace(model.sensor, clutter_density=density)
    )
