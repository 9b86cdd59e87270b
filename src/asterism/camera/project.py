"""Projection of points through several cameras at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.camera.projection import Projection
from asterism.camera.surfaces import check_surfaces, compile_surfaces
from asterism.checks import check_number
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera.surfaces import Surface

__all__ = ["CLEARANCE", "as_coordinates", "project_points"]

CLEARANCE = 1e-6
"""Distance in front of a point, metres, in which a surface does not occlude it."""


def project_points(
    cameras: Sequence[_engine.Camera],
    points: ArrayLike,
    surfaces: Sequence[Surface],
    clearance: float,
) -> Projection:
    """Project points through several cameras.

    Parameters
    ----------
    cameras : sequence of _engine.Camera
        Cameras of the engine.
    points, surfaces, clearance
        As for `Camera.project`.

    Returns
    -------
    Projection
        With a leading axis of cameras.
    """
    p = as_coordinates("points", points, 3)
    check_number("clearance", clearance, above=0, closed=True)
    shape: tuple[int, ...] = p.shape[:-1]
    check_surfaces(surfaces)
    # Moving surfaces belong to the first axis of the points.
    is_moving = len(shape) > 1 or any(s.n_moments > 1 for s in surfaces)
    n_frames = shape[0] if is_moving and shape else 1
    compiled = compile_surfaces(surfaces, n_frames) if len(surfaces) else []
    if not p.size:
        n_frames, compiled = 1, []
    pixels, depth, reason, occluded_by = _engine.project(
        cameras=cameras,
        points=p.reshape(n_frames, -1, 3),
        surfaces=compiled,
        clearance=float(clearance),
    )
    C = len(cameras)
    return Projection(
        pixels=pixels.reshape(C, *shape, 2),
        depth=depth.reshape(C, *shape),
        reason=reason.reshape(C, *shape),
        occluded_by=occluded_by.reshape(C, *shape),
    )


def as_coordinates(name: str, value: ArrayLike, n: int) -> NDArray[np.float64]:
    """Return an array of coordinates, or raise. NaN is accepted for an absent point.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    value : array_like of shape (..., n)
        The coordinates.
    n : int
        Number of coordinates of a point.

    Returns
    -------
    ndarray of shape (..., n)
        C-contiguous; masked items are NaN.

    Raises
    ------
    ParameterError
        If the shape or the type is another.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise ParameterError(name, f"an array of shape (..., {n})", str(error)) from error
    if isinstance(value, np.ma.MaskedArray):
        array = np.where(np.ma.getmaskarray(value), np.nan, array)
    if array.dtype.kind not in "iuf" or array.ndim < 1 or array.shape[-1] != n:
        got = f"shape {array.shape} of {array.dtype}"
        raise ParameterError(name, f"an array of shape (..., {n}) of numbers", got)
    return np.ascontiguousarray(array, dtype=np.float64)
