"""Detections read from a file, together with the other content of the file."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from asterism.checks import keep_array
from asterism.model.detections import Detections
from asterism.model.tracks import Tracks
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model.side_data import Analog, Event, ForcePlate

__all__ = ["Capture"]


_UNKNOWN = np.empty(0, dtype=np.int64)
_UNKNOWN.flags.writeable = False


def _unknown() -> NDArray[np.int64]:
    """Return the placeholder that `__post_init__` replaces by an array of -1, one a point."""
    return _UNKNOWN


@record(eq=False)
class Capture(Detections):
    """Detections read from a file, with the file's labels, names, analog channels and events.

    Parameters
    ----------
    path : Path
        The file. When a result is written in the same format, all content of this file except the
        points is copied from it.
    format : str
        Format of the file, a key of `asterism.io.CAPTURE_FORMATS`.
    rate : float
        Frames per second as stated in the file, 0 if the file states none.
    first_frame : int
        Number of the first frame in the file's own numbering.
    units : str
        Unit of length in the file, for example "mm". `points` are always metres.
    channels : array_like of int, shape (N,)
        Channel (column, trajectory) of each detection in the file, -1 if it has none. All -1 by
        default.
    labels : array_like of int, shape (N,)
        Track of each detection according to the file, -1 if it has none. Each named channel is one
        track; an unnamed channel is split at its gaps, because recording software reuses unnamed
        channels for other markers. All -1 by default.
    names : tuple of str or None
        Name of each track of `labels`, None if it has no name.
    modelled : tuple of str
        Names of computed points (joint centres, angles, forces), which are not read as detections.
    analog : Analog, optional
        Analog channels of a C3D file, None if there are none.
    events : tuple of Event
        Events of a C3D file, ordered by time.
    plates : tuple of ForcePlate
        Force plates of a C3D file.
    warnings : tuple of str
        Irregularities of the file, each with the way in which it was read.
    truncated : str
        Place where the file, or its source file, is cut off, and what is missing; empty for a
        complete file. The capture holds the complete frames.

    See Also
    --------
    asterism.read : Read a capture from a file.

    Examples
    --------
    >>> from dataclasses import replace
    >>> capture = Capture.from_frames([0.0, 0.01], [[[0, 0, 0], [1, 0, 0]], [[0, 0, 0]]])
    >>> replace(capture, path=Path("arena.dots"), format="dots", units="cm")
    Capture('arena.dots', 2 frames, 3 points, 3-D, 0 to 0.01 s, 0 named)
    >>> replace(capture, labels=[0, 1, 0], names=("LASI", "RASI")).tracks.names
    ('LASI', 'RASI')
    """

    path: Path = field(default_factory=Path)
    format: str = ""
    rate: float = 0.0
    first_frame: int = 1
    units: str = "m"
    channels: NDArray[np.int64] = field(default_factory=_unknown)
    labels: NDArray[np.int64] = field(default_factory=_unknown)
    names: tuple[str | None, ...] = ()
    modelled: tuple[str, ...] = ()
    analog: Analog | None = None
    events: tuple[Event, ...] = ()
    plates: tuple[ForcePlate, ...] = ()
    warnings: tuple[str, ...] = ()
    truncated: str = ""

    PER_POINT: ClassVar[tuple[str, ...]] = (*Detections.PER_POINT, "channels", "labels")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("channels", "labels"):
            given = getattr(self, name)
            if given is _UNKNOWN:
                given = np.full(self.n_points, -1)
            array = keep_array(name, given, (self.n_points,), dtype=np.int64)
            object.__setattr__(self, name, array)

    @property
    def tracks(self) -> Tracks:
        """Tracks according to the file; they are the ground truth if the file is labelled."""
        return Tracks(detections=self, labels=self.labels, names=self.names)

    def __repr__(self) -> str:
        n_named = sum(name is not None for name in self.names)
        return f"Capture({self.path.name!r}, {self.summary()}, {n_named} named)"
