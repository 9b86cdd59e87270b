"""Figure of the coverage of a rig at one height."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from asterism.camera import Coverage
from asterism.checks import check_fields, check_kind, check_number
from asterism.errors import ParameterError
from asterism.plot.style import CLUTTER, GRADIENT, GRID, INK, new_axes, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from numpy.typing import NDArray

__all__ = ["counts_map", "draw_bar", "plot_coverage", "whole_ticks"]

_MOST = 0.98  # share of the errors that the colours tell apart; the rest is off the scale
_N_TICKS, _MOST_TICKS = 6, 16


def plot_coverage(
    coverage: Coverage,
    *,
    height: float | None = None,
    what: Literal["cameras", "error"] = "cameras",
    ax: Axes | None = None,
) -> Axes:
    """Draw one horizontal level of the coverage of a rig, seen from above.

    Cells that fewer than two cameras see are hatched; no point can be triangulated there.

    Parameters
    ----------
    coverage : Coverage
        Coverage of a `volume_grid`, from `Rig.coverage`.
    height : float, optional
        Height z in metres; the nearest level of the grid is drawn. By default the middle one.
    what : {"cameras", "error"}
        "cameras" draws the number of cameras that see a cell, "error" the root mean square error of
        a point triangulated there, in millimetres.
    ax : Axes, optional
        Axes to draw on. By default a new figure.

    Returns
    -------
    Axes
        x and y in metres, to one scale, with a colour bar.

    Raises
    ------
    ParameterError
        If `coverage` is of another type or not of a grid, or has no level near `height`.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2)
    >>> grid = am.camera.volume_grid((-1, -1, 0), (1, 1, 2), 0.5)
    >>> am.plot.plot_coverage(rig.coverage(grid), height=1).get_xlabel()
    'x [m]'
    """
    from matplotlib.colors import LogNorm

    check_kind("coverage", coverage, Coverage, "rig.coverage(am.camera.volume_grid(…))")
    check_fields("what", [what], ("cameras", "error"))
    x, y, z, spacing = _grid(coverage.points)
    if height is not None:
        check_number("height", height)
    level = int(np.argmin(np.abs(z - height))) if height is not None else len(z) // 2
    if height is not None and abs(z[level] - height) > spacing:
        raise ParameterError("height", f"a height from {z[0]:g} to {z[-1]:g} m", f"{height:g}")
    axes: Any = ax if ax is not None else new_axes(height=6.0)
    n = coverage.n_cameras[:, :, level].T
    edges = [np.append(a - spacing / 2, a[-1] + spacing / 2) for a in (x, y)]
    if what == "cameras":
        colours, norm = counts_map(int(coverage.n_cameras.max(initial=0)))
        drawn = axes.pcolormesh(*edges, n, cmap=colours, norm=norm, rasterized=n.size > 5000)
        draw_bar(axes, drawn, "cameras that see it", ticks=whole_ticks(coverage.n_cameras))
        text = f"{100 * (n >= 2).mean():.3g} % of the cells seen by two or more"
    else:
        error = 1e3 * coverage.error[:, :, level].T
        known = error[np.isfinite(error)]
        top = float(np.quantile(known, _MOST)) if known.size else 1.0
        bottom = float(known.min(initial=top))
        drawn = axes.pcolormesh(
            *edges, np.ma.masked_invalid(error), cmap=f"{GRADIENT}_r", rasterized=n.size > 5000,
            norm=LogNorm(bottom, max(top, 1.001 * bottom)),
        )  # fmt: skip
        if known.size:
            label = f"error [mm] at {coverage.sigma_px:g} px of noise"
            draw_bar(axes, drawn, label, ticks=np.geomspace(bottom, top, _N_TICKS), extend="max")
        text = f"median error {np.median(known):.3g} mm" if known.size else "no error known"
    _hatch(axes, edges, n < 2)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x [m]", color=INK)
    axes.set_ylabel("y [m]", color=INK)
    tidy(axes)
    axes.set_title(f"z = {z[level]:.3g} m: {text}", fontsize=11, color=INK, loc="left")
    return axes


def counts_map(n_most: int) -> tuple[ListedColormap, BoundaryNorm]:
    """Return the colours of 0 … `n_most` cameras: white and grey for 0 and 1, then a gradient."""
    import matplotlib
    from matplotlib.colors import BoundaryNorm, ListedColormap

    graded = matplotlib.colormaps[GRADIENT](np.linspace(0, 1, max(n_most - 1, 1)))
    colours = ListedColormap(["white", GRID, *map(tuple, graded)])
    return colours, BoundaryNorm(np.arange(-0.5, colours.N + 0.5), colours.N)


def whole_ticks(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return whole numbers from 0 to the largest count, as ticks of a colour bar."""
    n_most = max(int(counts.max(initial=0)), 2)
    return np.arange(0, n_most + 1, 1 + n_most // _MOST_TICKS)


def draw_bar(
    axes: Any,
    drawn: ScalarMappable,
    label: str,
    *,
    ticks: NDArray[np.float64] | NDArray[np.int64] | None = None,
    **options: Any,
) -> None:
    """Draw a colour bar with a label and, if given, ticks with numbers."""
    bar = axes.figure.colorbar(drawn, ax=axes, shrink=0.85, pad=0.02, **options)
    bar.set_label(label, color=INK)
    bar.ax.tick_params(colors=INK, labelsize=8, length=3)
    bar.outline.set(edgecolor=GRID, linewidth=0.8)
    if ticks is not None:
        bar.set_ticks(ticks.tolist(), labels=[f"{tick:.3g}" for tick in ticks])
        bar.minorticks_off()


def _grid(
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Return the coordinates of a grid along its axes, and the spacing."""
    expected = "places of a volume_grid, shape (n_x, n_y, n_z, 3)"
    if points.ndim != 4 or not points.size:
        raise ParameterError("coverage", expected, f"shape {points.shape}")
    x, y, z = points[:, 0, 0, 0], points[0, :, 0, 1], points[0, 0, :, 2]
    steps = np.concatenate([np.diff(a) for a in (x, y, z)])
    spacing = float(steps[0]) if len(steps) else 1.0
    even = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    tolerance = 1e-6 * spacing
    if not (
        spacing > 0
        and np.allclose(steps, spacing, rtol=1e-6, atol=0)
        and np.allclose(points, even, rtol=0, atol=tolerance)
    ):
        raise ParameterError("coverage", expected, "places that are no even grid")
    return x, y, z, spacing


def _hatch(axes: Any, edges: list[NDArray[np.float64]], is_marked: NDArray[np.bool_]) -> None:
    """Hatch cells, with one rectangle for each run of cells in a row."""
    from matplotlib.collections import PolyCollection

    rectangles: list[list[tuple[float, float]]] = []
    for j, row in enumerate(is_marked):
        change = np.diff(np.concatenate([[0], row.astype(np.int8), [0]]))
        low, high = float(edges[1][j]), float(edges[1][j + 1])
        for begin, end in zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True):
            left, right = float(edges[0][begin]), float(edges[0][end])
            rectangles.append([(left, low), (right, low), (right, high), (left, high)])
    if rectangles:
        hatched = PolyCollection(rectangles, facecolors="none", edgecolors=CLUTTER, linewidths=0)
        hatched.set(hatch="////", label="under two cameras")
        axes.add_collection(hatched)
