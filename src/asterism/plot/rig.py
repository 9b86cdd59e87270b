"""Positions and views of the cameras of a rig."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.plot.coverage import counts_map, draw_bar, whole_ticks
from asterism.plot.outlines import outlines
from asterism.plot.space import to_scale
from asterism.plot.style import CYCLE, INK, new_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from asterism.camera import Camera, Coverage, Surface

__all__ = ["plot_rig"]

_SIDE = 8  # pieces of a side of the image, which a lens bends
_LEAST = 0.3  # cosine to the axis: rays far from it would end anywhere
_FEW, _MANY = 200, 5000  # dots that are drawn larger; beyond which a vector file has an image


def plot_rig(
    rig: Rig,
    *,
    points: ArrayLike | None = None,
    surfaces: Sequence[Surface] = (),
    moment: int = 0,
    coverage: Coverage | None = None,
    length: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the cameras of a rig in 3-D, with optional points, surfaces and coverage.

    Parameters
    ----------
    rig : Rig
        Cameras, each drawn as a pyramid from its centre along the rays of the border of its image.
        If the lens model does not reach the border, the outermost valid pixels are used.
    points : array_like of shape (..., 3), optional
        Points in world coordinates, metres, drawn as dots; NaN for missing ones.
    surfaces : sequence of Surface
        Surfaces, drawn as outlines.
    moment : int
        Index of the frame for moving surfaces.
    coverage : Coverage, optional
        Positions that two or more cameras see, coloured by their number.
    length : float, optional
        Length of the pyramids in metres. By default a ninth of the width of the scene.
    ax : Axes, optional
        Three-dimensional axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Metres on all axes, to one scale.

    Examples
    --------
    >>> import asterism as am
    >>> am.plot.plot_rig(am.Rig.ring(4, radius=3, height=2)).get_zlabel()
    'z [m]'
    """
    check_kind("rig", rig, Rig, "am.Rig((camera,))")
    axes: Any = ax if ax is not None else new_axes(solid=True, height=6.0)
    dots = np.empty((0, 3)) if points is None else _finite(points)
    lines = [line for surface in surfaces for line in outlines(surface, moment)]
    places = np.stack([camera.center for camera in rig])
    extent = np.concatenate([places, dots, *lines, *_limits(axes)])
    if coverage is not None:
        extent = np.concatenate([extent, coverage.points.reshape(-1, 3)])
    if length is None:
        length = 0.11 * max(float(np.ptp(extent, axis=0).max()), 1.0)
    check_number("length", length, above=0)
    for camera, place, name in zip(rig, places, rig.names, strict=True):
        rays = _edge(camera)
        edge = place + length * rays / np.maximum(rays @ camera.axis, _LEAST)[:, None]
        _draw_pyramid(axes, place, edge)
        axes.text(*place, f" {name}", fontsize=7, color=INK, parse_math=False)
        extent = np.concatenate([extent, edge])
    axes.scatter(*places.T, s=9, c=INK, linewidths=0, depthshade=False)
    if len(dots):
        axes.scatter(
            *dots.T, s=4 if len(dots) > _FEW else 10, c=CYCLE[5], linewidths=0, depthshade=False,
            rasterized=len(dots) > _MANY,
        )  # fmt: skip
    for line in lines:
        axes.plot(*line.T, color=CYCLE[2], linewidth=0.9)
    if coverage is not None:
        _draw_coverage(axes, coverage)
    to_scale(axes, extent, zoom=0.98)
    title = f"{len(rig)} cameras"
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    return axes


def _finite(points: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise ParameterError("points", "an array of shape (..., 3)", f"shape {array.shape}")
    array = array.reshape(-1, 3)
    return array[np.isfinite(array).all(axis=1)]


def _limits(axes: Any) -> list[NDArray[np.float64]]:
    """Corners of what the axes already show, shape (2, 3); none if they are empty."""
    if not axes.has_data():
        return []
    return [np.stack([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)]


def _edge(camera: Camera) -> NDArray[np.float64]:
    """Return the unit rays of the pixels along the edge of the image, shape (n, 3), in order."""
    w, h = camera.size_px
    share = np.linspace(0, 1, _SIDE, endpoint=False)
    zero, one = np.zeros(_SIDE), np.ones(_SIDE)
    u = np.concatenate([share, one, 1 - share, zero]) * w - 0.5
    v = np.concatenate([zero, share, one, 1 - share]) * h - 0.5
    edge = np.stack([u, v], axis=1)
    middle = np.array([(w - 1) / 2, (h - 1) / 2])
    # The lens model may not reach the edge of the image: of each line from the edge to the
    # middle, the first pixel with a ray is taken.
    inward = np.linspace(1, 0, 65)[:, None, None]
    rays = camera.rays(middle + inward * (edge - middle))
    is_reached = np.isfinite(rays[..., 0])
    first = np.argmax(is_reached, axis=0)
    found = rays[first, np.arange(len(edge))]
    return found[is_reached.any(axis=0)]


def _draw_pyramid(axes: Any, place: NDArray[np.float64], edge: NDArray[np.float64]) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    if not len(edge):  # the lens reaches nothing that was tried: a dot is all there is
        return
    corners = edge[:: max(1, len(edge) // 4)]
    lines = [np.stack([place, corner]) for corner in corners]
    lines.append(np.concatenate([edge, edge[:1]]))
    axes.add_collection3d(Line3DCollection(lines, colors=CYCLE[0], linewidths=0.8))
    axes.add_collection3d(Poly3DCollection([edge], facecolors=CYCLE[0], alpha=0.12, linewidths=0))


def _draw_coverage(axes: Any, coverage: Coverage) -> None:
    n = coverage.n_cameras.ravel()
    is_kept = n >= 2
    if not is_kept.any():
        return
    colours, norm = counts_map(int(n.max()))
    drawn = axes.scatter(
        *coverage.points.reshape(-1, 3)[is_kept].T, s=6, c=n[is_kept], cmap=colours, norm=norm,
        alpha=0.7, linewidths=0, depthshade=False, rasterized=int(is_kept.sum()) > _MANY,
    )  # fmt: skip
    draw_bar(axes, drawn, "cameras that see it", ticks=whole_ticks(n))
