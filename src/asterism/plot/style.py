"""The one style of all pictures."""

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

# Okabe & Ito (2008), told apart by colour-blind people and in grey; its black is kept for text and
# its yellow, too pale on white, is darkened.
CYCLE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#B8A800")
RIGHT, WRONG, MISSED = "#0072B2", "#D55E00", "#E69F00"
CLUTTER, INK, GRID = "#8C8C8C", "#333333", "#E6E6E6"
GRADIENT = "viridis"
"""The colour map of everything continuous: even in lightness, the same to colour-blind people."""


def new_axes(*, solid: bool = False, height: float = 5.0) -> Axes:
    """Make a figure without pyplot and give its axes.

    Parameters
    ----------
    solid : bool
        Whether the axes are three-dimensional.
    height : float
        Of the figure, inches.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, height), layout="constrained", dpi=120)
    return figure.add_subplot(projection="3d" if solid else None)


def new_panels(n_rows: int, n_columns: int = 1, *, width: float, height: float) -> list[Axes]:
    """Make a figure of several panels without pyplot and give their axes, row by row.

    Parameters
    ----------
    n_rows, n_columns : int
        How they lie.
    width, height : float
        Of the figure, inches.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=120)
    return list(np.ravel(figure.subplots(n_rows, n_columns, squeeze=False)))


def given_axes(ax: Sequence[Axes], n: int, what: str) -> list[Axes]:
    """Return axes that a caller passed as a list, or raise if they are not `n`.

    Raises
    ------
    ParameterError
        If there are more or fewer; `what` says what each is for.
    """
    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != n:
        raise ParameterError("ax", f"{n} axes, one for each {what}", len(axes))
    return axes


def tidy(axes: Axes) -> None:
    """Set the style on flat axes: no frame, unobtrusive ticks."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(CLUTTER)
    axes.tick_params(colors=INK, labelsize=9, length=3)
    axes.set_axisbelow(True)
