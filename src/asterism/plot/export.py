"""Reproducible export of figures: the same data give the same bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from asterism.checks import check_fields
from asterism.io.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["SUFFIXES", "figure_bytes", "write_figure"]

SUFFIXES = ("pdf", "png", "svg")
"""Suffixes of the formats of figures."""

# Without dates, versions and random names, all of which would differ from run to run.
_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "ModDate": None, "Producer": None, "Creator": None},
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
}
# TrueType in PDF: text that can be searched and edited, and that journals accept.
_OPTIONS: Any = {"svg.hashsalt": "asterism", "pdf.fonttype": 42}


def figure_bytes(
    picture: Figure | Axes | Sequence[Axes],
    ending: str,
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> bytes:
    """Render a figure as PDF, PNG or SVG; the same data give the same bytes.

    Parameters
    ----------
    picture : Figure, Axes or sequence of Axes
        Result of a plot function, or its figure.
    ending : {"pdf", "png", "svg"}
        Format of the file.
    size : (float, float), optional
        Width and height in inches; by default those of the figure.
    dpi : float, optional
        Dots per inch of a PNG, and of the parts of a PDF or SVG that are images; by default those
        of the figure.

    Returns
    -------
    bytes
        Content of the file. Its metadata have neither date nor version.

    Raises
    ------
    ParameterError
        If the ending is unknown.

    Examples
    --------
    >>> import asterism as am
    >>> am.plot.figure_bytes(am.plot.plot_presence(am.simulate.cube(seed=1)), "pdf")[:5]
    b'%PDF-'
    """
    import matplotlib

    check_fields("ending", [ending], SUFFIXES)
    first: Any = picture[0] if isinstance(picture, (list, tuple)) else picture
    figure = getattr(first, "figure", first)
    figure = getattr(figure, "figure", figure)  # the whole figure, if it is a subfigure
    file = io.BytesIO()
    with matplotlib.rc_context(_OPTIONS):
        if size is not None:
            figure.set_size_inches(size)
        figure.savefig(file, format=ending, dpi=dpi or "figure", metadata=_METADATA[ending])
    return file.getvalue()


def write_figure(
    picture: Figure | Axes | Sequence[Axes],
    path: Path,
    *,
    size: tuple[float, float] | None = None,
    dpi: float | None = None,
) -> None:
    """Write a figure to a file, completely or not at all.

    Parameters
    ----------
    picture : Figure, Axes or sequence of Axes
        Result of a plot function, or its figure.
    path : Path
        File to write; its ending, .pdf, .png or .svg, selects the format.
    size : (float, float), optional
        Width and height in inches. By default those of the figure.
    dpi : float, optional
        Dots per inch, as in `figure_bytes`.

    Raises
    ------
    ParameterError
        If the ending is unknown.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> axes = am.plot.plot_presence(am.simulate.cube(frames=10, seed=1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "presence.svg")
    ...     write_figure(axes, path)
    ...     path.stat().st_size > 1000
    True
    """
    content = figure_bytes(picture, path.suffix.lower().removeprefix("."), size=size, dpi=dpi)
    with replacing(path) as file:
        file.write(content)
