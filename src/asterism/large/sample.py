"""The tracking model of a large scene, estimated from a spatial crop of its first frames."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model import Detections
from asterism.tracking import estimate_model

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from asterism.model import TrackingModel

__all__ = ["SAMPLE_FRAMES", "SAMPLE_POINTS", "crop", "estimate_from_start"]

SAMPLE_FRAMES = 30
SAMPLE_POINTS = 1500
"""Frames, and detections of the first of them, from which the model is estimated."""


def crop(frames: Iterable[tuple[float, NDArray[np.float64]]]) -> Detections:
    """Return the first frames of a scene within a cube about its median.

    Parameters
    ----------
    frames : iterable of (float, ndarray of shape (N, D))
        Times, seconds, and detections, metres. At most `SAMPLE_FRAMES` are taken.

    Returns
    -------
    Detections
        About `SAMPLE_POINTS` detections of the first frame that has any, and those of the frames
        after it in the same cube.

    Examples
    --------
    >>> points = np.random.default_rng(1).random((4000, 3))
    >>> crop([(0.0, points), (1.0, points)])
    Detections(2 frames, 3000 points, 3-D, 0 to 1 s)
    """
    times: list[float] = []
    inside: list[NDArray[np.float64]] = []
    centre, reach = np.zeros(0), np.inf
    for time, points in islice(frames, SAMPLE_FRAMES):
        if not len(centre) and len(points):
            centre = np.median(points, axis=0)
            if len(points) > SAMPLE_POINTS:
                distance = np.abs(points - centre).max(axis=1)
                reach = np.partition(distance, SAMPLE_POINTS - 1)[SAMPLE_POINTS - 1]
        if len(centre):
            points = points[np.abs(points - centre).max(axis=1) <= reach]
        times.append(time)
        inside.append(points)
    return Detections.from_frames(times, inside)


def estimate_from_start(frames: Iterable[tuple[float, NDArray[np.float64]]]) -> TrackingModel:
    """Estimate the model of a large scene from a crop of its first frames.

    The estimate of a whole scene would take hours. Markers that cross the border of the crop count
    as missed detections, so the detection probability is a little too small.

    Parameters
    ----------
    frames : iterable of (float, ndarray of shape (N, D))
        Times, seconds, and detections, metres.

    Returns
    -------
    TrackingModel

    Raises
    ------
    ParameterError
        If there are too few frames or detections.

    Examples
    --------
    >>> import asterism as am
    >>> round(estimate_from_start(am.simulate.cube(seed=1).detections).sensor.p_detection, 2)
    1.0
    """
    sample = crop(frames)
    if sample.n_frames < 3 or sample.n_points < 3:
        found = f"{sample.n_frames} frames with {sample.n_points} points"
        raise ParameterError("model", "a model, or at least 3 frames to estimate one", found)
    return estimate_model(sample).model
