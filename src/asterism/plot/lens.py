"""Distortion of a square grid by a lens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Camera
from asterism.checks import check_kind
from asterism.plot.image import frame_image, image_axes
from asterism.plot.style import CYCLE, GRID, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_lens"]

_CELLS = 8  # squares along the shorter side of the image
_PIECES = 160  # of a line of the grid
_SAMPLES = 640  # pixels along the longer side at which the domain of the lens is tried
_MARGIN = 0.12  # how far the bent grid may leave the image, as a share of its longer side


def plot_lens(camera: Camera, ax: Axes | None = None) -> Axes:
    """Draw the image of a square grid with the lens of a camera and, pale, without it.

    The grid is perpendicular to the optical axis and fills the image of the pinhole camera. Skew
    and unequal focal lengths affect both grids. Parts of the image that the lens model does not
    reach are hatched.

    Parameters
    ----------
    camera : Camera
        Camera to draw. Without a lens both grids are equal.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Pixels, u to the right and v down. The title has the largest shift of a point by the lens.

    Raises
    ------
    ParameterError
        If `camera` is not a `Camera`.

    References
    ----------
    The 2010 report, figure 3.6.

    Examples
    --------
    >>> import asterism as am
    >>> am.plot.plot_lens(am.Rig.ring(2, radius=3, height=2)[0]).get_ylabel()
    'v [px]'
    """
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    check_kind("camera", camera, Camera, "rig[0]")
    axes: Any = ax if ax is not None else image_axes(camera.size_px)
    w, h = camera.size_px
    lines = _grid(camera)
    ideal, bent = _pin_hole(camera, lines), camera.distort(lines)
    axes.add_collection(LineCollection(list(ideal), colors="#C4C4C4", linewidths=0.8, zorder=1))
    axes.add_collection(LineCollection(list(bent), colors=CYCLE[0], linewidths=1.0, zorder=3))
    frame_image(axes, camera.size_px)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    image = Rectangle((-0.5, -0.5), w, h, fill=False, edgecolor=INK, linewidth=1.2, zorder=4)
    axes.add_patch(image)
    shift = _draw_domain(axes, camera)
    margin = _MARGIN * max(w, h)
    inside = bent[np.isfinite(bent).all(axis=2)]
    low = np.clip(inside.min(axis=0, initial=-0.5), -0.5 - margin, None)
    high = np.clip(inside.max(axis=0, initial=-0.5), [w - 0.5, h - 0.5], [w + margin, h + margin])
    edge = 0.01 * max(w, h)  # the frame is a line, and has a width
    axes.set_xlim(low[0] - edge, high[0] + edge)
    axes.set_ylim(high[1] + edge, low[1] - edge)
    name = f"{camera.name}: " if camera.name else ""
    lens = "no lens" if camera.lens is None else type(camera.lens).__name__
    shift_text = "" if camera.lens is None else f", shifts points by up to {shift:.3g} px"
    axes.set_title(name + lens + shift_text, fontsize=11, color=INK, loc="left", parse_math=False)
    return axes


def _grid(camera: Camera) -> NDArray[np.float64]:
    """Lines of squares that fill the image without a lens, shape (L, n, 2), normalised."""
    w, h = camera.size_px
    corners = np.array([[u, v, 1.0] for u in (-0.5, w - 0.5) for v in (-0.5, h - 0.5)])
    normalised = np.linalg.solve(camera.K, corners.T)[:2]
    low, high = normalised.min(axis=1), normalised.max(axis=1)
    middle, half = (low + high) / 2, (high - low) / 2
    step = 2 * half.min() / _CELLS
    lines: list[NDArray[np.float64]] = []
    for axis in (0, 1):
        n = int(half[axis] / step + 1e-9)
        along = np.linspace(low[1 - axis], high[1 - axis], _PIECES + 1)
        for at in middle[axis] + step * np.arange(-n, n + 1):
            line = np.full((len(along), 2), at)
            line[:, 1 - axis] = along
            lines.append(line)
    return np.stack(lines)


def _pin_hole(camera: Camera, normalised: NDArray[np.float64]) -> NDArray[np.float64]:
    return normalised @ camera.K[:2, :2].T + camera.K[:2, 2]


def _draw_domain(axes: Any, camera: Camera) -> float:
    """Hatch pixels beyond the lens model, and return the largest shift of the others."""
    w, h = camera.size_px
    step = max(w, h) / _SAMPLES
    u = np.linspace(-0.5, w - 0.5, max(2, round(w / step)))
    v = np.linspace(-0.5, h - 0.5, max(2, round(h / step)))
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    normalised = camera.undistort(pixels)
    is_beyond = np.isnan(normalised[..., 0])
    if is_beyond.any():
        beyond = is_beyond.astype(float)
        area = axes.contourf(u, v, beyond, [0.5, 1.5], colors="#F7F7F7", hatches=["////"], zorder=2)
        area.set(edgecolor=GRID, linewidth=0)  # the colour of the hatching
        axes.contour(u, v, beyond, [0.5], colors=CYCLE[5], linewidths=1.6, zorder=4)
        axes.plot([], [], color=CYCLE[5], linewidth=1.6, label="the lens model ends")
        axes.legend(loc="lower right", fontsize=8, labelcolor=INK, framealpha=0.9, edgecolor=GRID)
    shift = np.linalg.norm(_pin_hole(camera, normalised) - pixels, axis=2)[~is_beyond]
    return float(shift.max(initial=0.0))
