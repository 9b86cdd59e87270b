"""Images of one camera: points with connecting lines, and depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Camera, DepthImage, Polygon, Projection, Reason
from asterism.checks import check_array, check_kind
from asterism.errors import ParameterError
from asterism.plot.coverage import draw_bar
from asterism.plot.outlines import outlines
from asterism.plot.style import CLUTTER, CYCLE, GRADIENT, GRID, INK, new_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from asterism.camera import Surface

__all__ = ["frame_image", "image_axes", "plot_depth", "plot_image"]

WORDS = {
    Reason.VISIBLE: "seen",
    Reason.OCCLUDED: "occluded",
    Reason.OUTSIDE: "outside",
    Reason.BEHIND: "behind",
    Reason.NEAR: "too near",
    Reason.FAR: "too far",
    Reason.LENS: "beyond the lens",
    Reason.ABSENT: "absent",
}
_PIECES = 32  # of an edge of a surface, which a lens bends


def plot_image(
    camera: Camera,
    projection: Projection,
    *,
    connections: ArrayLike | None = None,
    colours: str | Sequence[str] | None = None,
    names: Sequence[str | None] | None = None,
    surfaces: Sequence[Surface] = (),
    moment: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Draw the points of one frame in the image of one camera, with connecting lines.

    Visible points are filled. Points occluded by a surface are hollow, with dashed pale lines.
    Points outside the image are not drawn; the title counts them by reason. Lines are straight from
    point to point, without the distortion of the lens.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    projection : Projection
        Projection of K points by this camera, with arrays of shape (K,).
    connections : array_like of int, shape (K, K), optional
        Symmetric connection matrix: 0 for no line between two points, k ≥ 1 for a line in the k-th
        colour of the style, counted cyclically.
    colours : colour or K of them, optional
        Colours of the points. By default those of the style in turn.
    names : sequence of (str or None), optional
        K names that are written beside the points.
    surfaces : sequence of Surface
        Occluding surfaces; their distorted outlines are drawn.
    moment : int
        Index of the frame for moving surfaces.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Pixels, u to the right and v down, within the borders of the image.

    Raises
    ------
    ParameterError
        If an argument is of another type, the projection is not of one frame and one camera, or an
        argument does not have K entries.

    References
    ----------
    The 2010 report, §3.3 and 3.4.

    Examples
    --------
    >>> import asterism as am
    >>> camera = am.Rig.ring(4, radius=3, height=2)[0]
    >>> seen = camera.project([[0, 0, 1], [0.2, 0, 1]])
    >>> am.plot.plot_image(camera, seen, names=["A", "B"]).get_xlabel()
    'u [px]'
    """
    check_kind("camera", camera, Camera, "rig[0]")
    check_kind("projection", projection, Projection, "camera.project(points)")
    if projection.reason.ndim != 1:
        expected = "points of one frame in one camera, arrays of shape (K,)"
        got = f"reasons of shape {projection.reason.shape}"
        raise ParameterError("projection", expected, got, "index it: projection[camera][frame]")
    n = len(projection.reason)
    colour_of = _colours(colours, n)
    if names is not None and len(names) != n:
        raise ParameterError("names", f"{n}, one for each point", len(names))
    axes: Any = ax if ax is not None else image_axes(camera.size_px)
    for surface in surfaces:
        for line in outlines(surface, moment):
            edge = camera.project(_finely(line)).pixels
            # Limbs are many and lie over each other: pale, so that they do not bury the markers.
            is_flat = isinstance(surface, Polygon)
            pale = 1.0 if is_flat else 0.35
            axes.plot(*edge.T, color=CLUTTER, linewidth=0.8, alpha=pale, zorder=1)
            if is_flat and np.isfinite(edge).all():
                axes.fill(*edge.T, color=GRID, alpha=0.5, linewidth=0, zorder=0)
    is_seen = projection.visible
    is_drawn = is_seen | (projection.reason == Reason.OCCLUDED)
    if connections is not None:
        _draw_connections(axes, _checked(connections, n), projection.pixels, is_drawn, is_seen)
    axes.scatter(
        *projection.pixels[is_seen].T, s=20, c=colour_of[is_seen].tolist(), linewidths=0, zorder=3
    )
    is_occluded = is_drawn & ~is_seen
    axes.scatter(
        *projection.pixels[is_occluded].T, s=20, facecolors="white",
        edgecolors=colour_of[is_occluded].tolist(), linewidths=1.0, zorder=3,
    )  # fmt: skip
    for k in np.flatnonzero(is_drawn).tolist():
        if names is not None and names[k]:
            axes.annotate(
                names[k], projection.pixels[k], xytext=(4, 3), textcoords="offset points",
                fontsize=7, color=INK, annotation_clip=True, parse_math=False,
            )  # fmt: skip
    counts = projection.counts()
    shown = [f"{counts[r]} {word}" for r, word in WORDS.items() if counts[r] or r == Reason.VISIBLE]
    before = f"{camera.name}: " if camera.name else ""
    title = before + ", ".join(shown)
    axes.set_title(title, fontsize=11, color=INK, loc="left", parse_math=False)
    frame_image(axes, camera.size_px)
    return axes


def plot_depth(depth: DepthImage | ArrayLike, ax: Axes | None = None) -> Axes:
    """Draw a depth image, from dark (near) to light (far); pixels without a surface are white.

    Parameters
    ----------
    depth : DepthImage or array_like of shape (height, width)
        Depth along the optical axis in metres; infinite without a surface.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        Pixels, with a colour bar in metres.

    Raises
    ------
    ParameterError
        If `depth` is not an image.

    Examples
    --------
    >>> import asterism as am
    >>> am.plot.plot_depth([[1.0, 2.0], [2.0, float("inf")]]).get_ylabel()
    'v [px]'
    """
    given = depth.depth if isinstance(depth, DepthImage) else depth
    image = check_array("depth", given, ("height", "width"), finite=False)
    if not image.size:
        raise ParameterError("depth", "at least one pixel", f"shape {image.shape}")
    height, width = image.shape
    axes: Any = ax if ax is not None else image_axes((width, height))
    is_known = np.isfinite(image)
    drawn = axes.imshow(np.ma.array(image, mask=~is_known), cmap=GRADIENT, interpolation="nearest")
    title = f"{100 * is_known.mean():.3g} % of the pixels see something"
    if is_known.any():
        draw_bar(axes, drawn, "depth [m]")
    axes.set_title(title, fontsize=11, color=INK, loc="left")
    frame_image(axes, (width, height))
    return axes


def image_axes(size_px: tuple[int, int]) -> Axes:
    """Return new axes with the aspect ratio of an image, width and height in pixels."""
    width, height = size_px
    return new_axes(height=float(np.clip(7.2 * height / width + 0.9, 3.0, 11.0)))


def frame_image(axes: Any, size_px: tuple[int, int]) -> None:
    """Set the limits and the style of axes to those of an image in pixels, to one scale."""
    width, height = size_px
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_aspect("equal", adjustable="box")
    for spine in axes.spines.values():
        spine.set_color(CLUTTER)
    axes.set_xlabel("u [px]", color=INK)
    axes.set_ylabel("v [px]", color=INK)
    axes.tick_params(colors=INK, labelsize=9, length=3)
    axes.set_facecolor("white")
    axes.grid(visible=False)


def _colours(colours: str | Sequence[str] | None, n: int) -> NDArray[np.object_]:
    if colours is None:
        return np.array(CYCLE, dtype=object)[np.arange(n) % len(CYCLE)]
    if isinstance(colours, str):
        return np.full(n, colours, dtype=object)
    if len(colours) != n:
        raise ParameterError("colours", f"one, or {n}: one for each point", len(colours))
    listed = np.empty(n, dtype=object)  # a colour may be a tuple of numbers
    listed[:] = list(colours)
    return listed


def _checked(connections: ArrayLike, n: int) -> NDArray[np.int64]:
    matrix = check_array("connections", connections, (n, n), dtype=np.int64)
    if (matrix < 0).any():
        raise ParameterError("connections", "0 for no line, k ≥ 1 for a colour", matrix.min())
    odd = np.argwhere(matrix != matrix.T)
    if len(odd):
        i, j = (int(k) for k in odd[0])
        got = f"{matrix[i, j]} at ({i}, {j}) and {matrix[j, i]} at ({j}, {i})"
        raise ParameterError("connections", "a symmetric matrix", got)
    return matrix


def _draw_connections(
    axes: Any,
    matrix: NDArray[np.int64],
    pixels: NDArray[np.float64],
    is_drawn: NDArray[np.bool_],
    is_seen: NDArray[np.bool_],
) -> None:
    """Draw the lines of which both ends are drawn: dashed and pale if an end is occluded."""
    from matplotlib.collections import LineCollection

    i, j = np.nonzero(np.triu(matrix, 1))
    is_kept = is_drawn[i] & is_drawn[j]
    i, j = i[is_kept], j[is_kept]
    colour = np.array(CYCLE, dtype=object)[(matrix[i, j] - 1) % len(CYCLE)]
    is_whole = is_seen[i] & is_seen[j]
    segments = np.stack([pixels[i], pixels[j]], axis=1)
    for chosen, look in (
        (is_whole, {"linewidths": 1.4}),
        (~is_whole, {"linewidths": 1.0, "linestyles": "dashed", "alpha": 0.45}),
    ):
        lines = LineCollection(
            list(segments[chosen]), colors=colour[chosen].tolist(), zorder=2, **look
        )
        axes.add_collection(lines, autolim=False)


def _finely(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide each piece of a line through points (n, 3) into many."""
    share = np.linspace(0, 1, _PIECES, endpoint=False)[:, None]
    pieces = line[:-1, None] + share * np.diff(line, axis=0)[:, None]
    return np.concatenate([pieces.reshape(-1, 3), line[-1:]])
