"""Detections that came from a file, and what else the file knew."""

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
    """Stand for -1 throughout, until the number of points is known."""
    return _UNKNOWN


@record(eq=False)
class Capture(Detections):
    """Detections that were read from a file, with what else the file knew.

    Parameters
    ----------
    path : Path
        The file; writing a result in the same format takes from it all that is not a point.
    format : str
        Its format, a key of `asterism.io.CAPTURE_FORMATS`.
    rate : float
        Frames a second as the file states it, 0 where it does not.
    first_frame : int
        The file's number of its first frame.
    units : str
        The unit of length in the file, "mm" say; `points` are metres whatever it is.
    channels : array_like of int, shape (N,)
        The file's own channel (column, trajectory) of each detection, -1 where there is none; -1
        throughout unless given.
    labels : array_like of int, shape (N,)
        The file's own identities: one for each named channel and one for each unbroken piece of
        an unnamed channel, because recorders reuse those for other markers; -1 where none, and
        throughout unless given.
    names : tuple of str or None
        Name of each identity, None where it has none.
    modelled : tuple of str
        Names of computed points (joint centres, angles, forces) that were left out.
    analog : Analog, optional
        Analog channels of a C3D file, None where there are none.
    events : tuple of Event
        Moments that a C3D file marks, by time.
    plates : tuple of ForcePlate
        Force plates of a C3D file.
    warnings : tuple of str
        What was odd about the file and how it was taken.
    truncated : str
        Where the file, or the one that it was made from, is cut off and what is missing; empty for
        a whole file. The capture holds the complete frames.

    See Also
    --------
    asterism.read : makes one.

    Examples
    --------
    >>> from dataclasses import replace
    >>> capture = Capture.from_frames([0.0, 0.01], [[[0, 0, 0], [1, 0, 0]], [[0, 0, 0]]])
    >>> replace(capture, path=Path("arena.dots"), format="dots", units="cm")
    Capture('arena.dots', 2 frames, 3 points, 3-D, 0 to 0.01 s, 0 named)
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
        """The file's own identities as `Tracks`: truth, where the file is labelled."""
        return Tracks(detections=self, labels=self.labels, names=self.names)

    def __repr__(self) -> str:
        n_named = sum(name is not None for name in self.names)
        return f"Capture({self.path.name!r}, {self.summary()}, {n_named} named)"
