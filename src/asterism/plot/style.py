"""The common style of all figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = [
    "CLUTTER",
    "CYCLE",
    "GRADIENT",
    "GRID",
    "INK",
    "MISSED",
    "RIGHT",
    "WRONG",
    "given_axes",
    "new_axes",
    "new_panels",
    "tidy",
]

# Okabe & Ito (2008), distinguishable for colour-blind readers and in grey. Black is reserved for
# text, and yellow, which is too pale on white, is darkened.
CYCLE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#B8A800")
RIGHT, WRONG, MISSED = "#0072B2", "#D55E00", "#E69F00"
CLUTTER, INK, GRID = "#8C8C8C", "#333333", "#E6E6E6"
GRADIENT = "viridis"
"""Colour map of continuous values: perceptually uniform, also for colour-blind readers."""


def new_axes(*, solid: bool = False, height: float = 5.0) -> Axes:
    """Return the axes of a new figure, made without pyplot.

    Parameters
    ----------
    solid : bool
        Whether the axes are three-dimensional.
    height : float
        Height of the figure, inches.

    Returns
    -------
    Axes
        Axes of the figure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained", dpi=120)
    return figure.add_subplot(projection="3d" if solid else None)


def new_panels(n_rows: int, n_columns: int = 1, *, width: float, height: float) -> list[Axes]:
    """Return the axes of a new figure of several panels, row by row, made without pyplot.

    Parameters
    ----------
    n_rows, n_columns : int
        Number of rows and columns of panels.
    width, height : float
        Size of the figure, inches.

    Returns
    -------
    list of Axes
        Axes of the panels.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=120)
    return list(np.ravel(figure.subplots(n_rows, n_columns, squeeze=False)))


def given_axes(ax: Sequence[Axes], n: int, what: str) -> list[Axes]:
    """Return the axes of a caller's sequence, or raise if they are not `n`.

    Parameters
    ----------
    ax : sequence of Axes
        Axes of the caller.
    n : int
        Required number.
    what : str
        Purpose of each, for the message.

    Returns
    -------
    list of Axes
        The same axes.

    Raises
    ------
    ParameterError
        If there are more or fewer.
    """
    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != n:
        raise ParameterError("ax", f"{n} axes, one for each {what}", len(axes))
    return axes


def tidy(axes: Axes) -> None:
    """Set the style of 2-D axes: no frame, small ticks."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(CLUTTER)
    axes.tick_params(colors=INK, labelsize=9, length=3)
    axes.set_axisbelow(True)
