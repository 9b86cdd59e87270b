"""What every camera of a rig saw in the course of a film."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Observations, Rig
from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.plot.image import frame_image
from asterism.plot.style import CLUTTER, CYCLE, INK, given_axes, new_panels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_projections"]

_MANY = 2000  # dots beyond which a vector file holds them as one image
_DOT = 2.5  # square points


def plot_projections(
    observations: Observations,
    rig: Rig,
    *,
    frames: slice | None = None,
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw image points of several cameras, one panel per camera.

    Parameters
    ----------
    observations : Observations
        Image points, from `asterism.simulate.film` or a file. With the true markers, each marker
        has the same colour in all images and false points are grey; otherwise all are grey.
    rig : Rig
        Rig with all cameras of the observations, for the sizes of their images.
    frames : slice, optional
        Frames to draw. By default all.
    ax : sequence of Axes, optional
        Axes to draw on, one per camera. By default a new figure.

    Returns
    -------
    list of Axes
        Pixels, u to the right and v down, within the borders of the image.

    Raises
    ------
    ParameterError
        If an argument is of another kind, a camera is not in the rig, or there are not as many
        axes as cameras.

    References
    ----------
    The 2010 report, §3.3.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(3, radius=5, height=2)
    >>> film = am.simulate.film(am.simulate.cube(frames=5, seed=1), rig)
    >>> len(am.plot.plot_projections(film.observations, rig))
    3
    """
    check_kind("observations", observations, Observations, "am.io.read_observations(path)")
    check_kind("rig", rig, Rig, "am.read_rig(path)")
    seen = observations
    sizes = dict(zip(rig.names, (camera.size_px for camera in rig), strict=True))
    for name in seen.cameras:
        if name not in sizes:
            raise ParameterError(
                "rig", f"the cameras of the film: {', '.join(seen.cameras)}", ", ".join(sizes)
            )
    n = seen.n_cameras
    if ax is None:
        n_columns = math.ceil(math.sqrt(n))
        n_rows = math.ceil(n / n_columns)
        width = float(np.clip(14.0 / n_columns, 2.2, 6.0))
        shape = float(np.median([sizes[name][1] / sizes[name][0] for name in seen.cameras]))
        made = new_panels(
            n_rows, n_columns, width=width * n_columns, height=(width * shape + 0.4) * n_rows
        )
        for empty in made[n:]:
            empty.remove()
        panels: list[Any] = made[:n]
    else:
        panels = list(given_axes(ax, n, "camera"))
    is_shown = np.zeros(seen.n_frames, dtype=bool)
    is_shown[frames if frames is not None else slice(None)] = True
    is_shown = is_shown[seen.frame_of]
    whose = seen.markers if seen.markers is not None else np.full(seen.n_points, -1)
    palette = np.array([*CYCLE, CLUTTER], dtype=object)
    colour = palette[np.where(whose < 0, len(CYCLE), whose % len(CYCLE))]
    for c, (axes, name) in enumerate(zip(panels, seen.cameras, strict=True)):
        # Clutter first, so that it lies under the markers.
        here = np.flatnonzero(is_shown & (seen.camera_of == c))
        here = here[np.argsort(whose[here] >= 0, kind="stable")]
        axes.scatter(
            *seen.pixels[here].T, s=_DOT, c=colour[here].tolist(), linewidths=0,
            rasterized=len(here) > _MANY,
        )  # fmt: skip
        frame_image(axes, sizes[name])
        axes.set(xlabel="", ylabel="")
        axes.tick_params(labelsize=6)
        title = f"{name}: {len(here):,} points"
        n_false = int((whose[here] < 0).sum())
        if seen.markers is not None and n_false:
            title += f", {n_false:,} false"
        axes.set_title(title, fontsize=9, color=INK, loc="left", parse_math=False)
    return panels
