"""Three-dimensional axes with equal scales."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.plot.style import CLUTTER, INK

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["to_scale"]


def to_scale(axes: Any, points: NDArray[np.float64], *, zoom: float = 0.85) -> None:
    """Set the style and equal scales on axes, with room for all points.

    Parameters
    ----------
    axes : Axes3D
        Axes to set.
    points : ndarray of shape (N, 3)
        Metres, all finite.
    zoom : float
        Size of the box in its axes; it leaves room for the names of the axes.
    """
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name} [m]", color=INK)
    axes.tick_params(colors=INK, labelsize=8)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor("white")
        axis.pane.set_edgecolor(CLUTTER)
    if not len(points):
        return
    low, high = points.min(axis=0), points.max(axis=0)
    # An axis without motion still needs room for its numbers.
    extent = np.maximum(high - low, max(0.25 * float((high - low).max()), 1e-3))
    middle = (low + high) / 2
    for i, name in enumerate("xyz"):
        half = 0.52 * float(extent[i])
        getattr(axes, f"set_{name}lim")(float(middle[i]) - half, float(middle[i]) + half)
        # Ticks at a spacing in metres, because a short axis has room for a few numbers only.
        getattr(axes, f"{name}axis").get_major_locator().set_params(
            nbins=max(2, round(7 * float(extent[i] / extent.max())))
        )
    axes.set_box_aspect(extent, zoom=zoom)
