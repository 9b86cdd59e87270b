"""The one list of file formats."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

from asterism.io.captures import (
    c3d,
    c3d_write,
    csv_long,
    csv_wide,
    motive_csv,
    pointcloud,
    qtm_tsv,
    trc,
)
from asterism.io.captures.rates import fixed_rate
from asterism.records import Registry, record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from asterism.model import Capture, Detections, Tracks

__all__ = ["CAPTURE_FORMATS", "CaptureFormat"]


def _holds_any(detections: Detections) -> None:
    """Accept detections of any axes and times."""


def _has_fixed_rate(format_name: str) -> Callable[[Detections], object]:
    """Return the check for 3-D points at a fixed rate, with the name of a format for messages."""

    def has_fixed_rate(detections: Detections) -> None:
        fixed_rate(detections, format_name)

    return has_fixed_rate


@record
class CaptureFormat:
    """File format of captures.

    Parameters
    ----------
    name : str
        Key in `CAPTURE_FORMATS`.
    extensions : tuple of str
        Suffixes of file names; "" for a name without one.
    description : str
        Description in one line.
    sniff : callable
        Function of the first bytes of a file: whether they are of this format.
    read : callable
        Function from a path to a `Capture`.
    write : callable or None
        Function that writes `Tracks` to an open binary file; None for a format that is only read.
    read_tracks : callable or None
        Function from a path to `Tracks`, for a format that holds more than a `Capture`.
    keeps_filled : bool
        Whether the format marks filled points.
    check : callable
        Function that raises `ParameterError` unless the format can hold the axes and the times of
        `Detections`. A command calls it before long work whose result it writes.

    Examples
    --------
    >>> import asterism as am
    >>> am.io.CAPTURE_FORMATS["trc"].extensions
    ('.trc',)
    """

    name: str
    extensions: tuple[str, ...]
    description: str
    sniff: Callable[[bytes], bool]
    read: Callable[[Path], Capture]
    write: Callable[[Tracks, IO[bytes]], None] | None = None
    read_tracks: Callable[[Path], Tracks] | None = None
    keeps_filled: bool = False
    check: Callable[[Detections], object] = _holds_any


CAPTURE_FORMATS: dict[str, CaptureFormat] = Registry(
    (f.name, f)
    for f in (
        CaptureFormat(
            name="c3d",
            extensions=(".c3d",),
            description="C3D of biomechanics, with all that its source held",
            sniff=c3d.sniff,
            read=c3d.read,
            write=c3d_write.write,
            keeps_filled=True,
            check=_has_fixed_rate("C3D"),
        ),
        CaptureFormat(
            name="trc",
            extensions=(".trc",),
            description="TRC of OpenSim and Motion Analysis",
            sniff=trc.sniff,
            read=trc.read,
            write=trc.write,
            check=_has_fixed_rate("TRC"),
        ),
        CaptureFormat(
            name="csv",
            extensions=(".csv",),
            description="CSV, one row a detection; keeps labels, names and confidence bit by bit",
            sniff=csv_long.sniff,
            read=csv_long.read,
            write=csv_long.write,
            read_tracks=csv_long.read_tracks,
            keeps_filled=True,
        ),
        CaptureFormat(
            name="csv-wide",
            extensions=(".csv",),
            description="CSV, one row a frame and three columns a marker",
            sniff=csv_wide.sniff,
            read=csv_wide.read,
            write=csv_wide.write,
        ),
        CaptureFormat(
            name="motive",
            extensions=(".csv",),
            description="CSV as OptiTrack Motive exports it",
            sniff=motive_csv.sniff,
            read=motive_csv.read,
        ),
        CaptureFormat(
            name="qtm",
            extensions=(".tsv",),
            description="TSV as Qualisys Track Manager exports it",
            sniff=qtm_tsv.sniff,
            read=qtm_tsv.read,
            write=qtm_tsv.write,
            check=_has_fixed_rate("TSV"),
        ),
        CaptureFormat(
            name="pointcloud",
            extensions=(".log", ".bin", ""),
            description="binary log of unlabelled point clouds (librigidbodytracker)",
            sniff=pointcloud.sniff,
            read=pointcloud.read,
            write=pointcloud.write,
            check=pointcloud.check,
        ),
    )
)
