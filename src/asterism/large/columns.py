"""Which columns of a plain table hold the frames, the times and the coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.checks import check_number
from asterism.errors import FormatError, ParameterError
from asterism.io.units import PER_METRE, parse_unit
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

__all__ = ["Columns", "Layout"]

_TIMES = ("time", "time_s", "t")
_FRAMES = ("frame", "frame_index")
_AXES = ("x", "y", "z")


@record
class Columns:
    """Names of the columns of a table, its unit of length and its frame rate.

    Parameters
    ----------
    frame : str, optional
        Column of the frame number, whole numbers. By default ``frame`` or ``frame_index``, if the
        table has one. Numbers that are left out are frames without detections.
    time : str, optional
        Column of the time, seconds. By default ``time``, ``time_s`` or ``t``, if the table has one.
        With both columns the times are those of this one.
    axes : sequence of str, optional
        Columns of two or three coordinates. By default ``x``, ``y`` and, if the table has it,
        ``z``, also with a unit: ``x_mm``.
    unit : {"mm", "cm", "m", "in", "ft"}, optional
        Unit of length. By default that of the columns' names, else metres.
    rate : float
        Frames per second of a table without times, > 0.
    label : str
        Name of the column of track labels in the output.

    Raises
    ------
    ParameterError
        If an option is not valid.

    Examples
    --------
    >>> Columns(axes=("u", "v"), unit="mm")
    Columns(axes=('u', 'v'), unit='mm')
    """

    frame: str | None = None
    time: str | None = None
    axes: Sequence[str] | None = None
    unit: str | None = None
    rate: float = 1.0
    label: str = "track"

    def __post_init__(self) -> None:
        if self.axes is not None and len(self.axes) not in (2, 3):
            raise ParameterError("axes", "two or three columns", repr(self.axes))
        if self.unit is not None and self.unit not in PER_METRE:
            raise ParameterError("unit", f"one of {', '.join(PER_METRE)}", repr(self.unit))
        check_number("rate", self.rate, above=0, below=1e9)
        if not self.label or set(self.label) & set(',;"\t\r\n'):
            raise ParameterError("label", "a name without separators", repr(self.label))

    def layout(self, path: Path, names: Sequence[str]) -> Layout:
        """Return the columns of one table.

        Parameters
        ----------
        path : Path
            File for messages.
        names : sequence of str
            Names of the table's columns.

        Returns
        -------
        Layout

        Raises
        ------
        FormatError
            If a column is missing or stands twice, or the column of labels exists already.
        """
        found = ", ".join(names)[:120] or "no columns"
        for wanted in (self.frame, self.time, *(self.axes or ())):
            if wanted is not None and wanted not in names:
                raise FormatError(path, "columns", f"one named {wanted}", found)
        if self.label in names:
            hint = "give the column of track labels another name (label, --label)"
            raise FormatError(path, "columns", f"no column {self.label} yet", found, hint)
        frame = self.frame or _first(_FRAMES, names)
        time = self.time or _first(_TIMES, names)
        axes, unit = tuple(self.axes or ()), self.unit
        if not axes:
            axes, own = _axes(names)
            unit = unit or own
        hint = "name the columns by options"
        if frame is None and time is None:
            expected = f"one of {', '.join(_FRAMES + _TIMES)}"
            raise FormatError(path, "columns", expected, found, hint)
        if not axes:
            raise FormatError(path, "columns", "coordinates x, y and perhaps z", found, hint)
        layout = Layout(
            frame=frame, time=time, axes=axes, per_metre=PER_METRE[unit or "m"],
            rate=float(self.rate), label=self.label,
        )  # fmt: skip
        for name in layout.numbers:
            if list(names).count(name) > 1:
                raise FormatError(path, "columns", f"one named {name}", "two")
        return layout


@record
class Layout:
    """Columns of one table.

    Attributes
    ----------
    frame, time : str or None
        Columns of the frame number and of the time; at least one.
    axes : tuple of str
        Columns of the coordinates, D of them.
    per_metre : float
        Units of length per metre.
    rate : float
        Frames per second, used without a column of times.
    label : str
        Column of track labels in the output.

    Examples
    --------
    >>> from pathlib import Path
    >>> Columns().layout(Path("swarm.csv"), ["t", "x_mm", "y_mm"])
    Layout(frame=None, time='t', axes=('x_mm', 'y_mm'), per_metre=1000, rate=1, label='track')
    """

    frame: str | None
    time: str | None
    axes: tuple[str, ...]
    per_metre: float
    rate: float
    label: str

    @property
    def numbers(self) -> tuple[str, ...]:
        """Columns that are read as numbers: frame, time, coordinates."""
        return tuple(c for c in (self.frame, self.time) if c is not None) + self.axes


def _first(wanted: Sequence[str], names: Sequence[str]) -> str | None:
    return next((name for name in wanted if name in names), None)


def _axes(names: Sequence[str]) -> tuple[tuple[str, ...], str | None]:
    """Return the columns x, y and z, and the unit in their names."""
    for suffix in ("", *(f"_{unit}" for unit in PER_METRE)):
        axes = tuple(axis + suffix for axis in _AXES if axis + suffix in names)
        if axes[:2] == (f"x{suffix}", f"y{suffix}"):
            return axes, parse_unit(suffix[1:]) if suffix else None
    return (), None
