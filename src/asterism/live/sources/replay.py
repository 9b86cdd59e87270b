"""Source: a capture that is played in real time, faster, or as fast as possible."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from asterism.errors import FormatError, SourceError
from asterism.io import read
from asterism.live.frame import SourceFrame
from asterism.live.sources.base import EndOfSource

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.model import Capture

__all__ = ["ReplaySource"]


class ReplaySource:
    """Source of the frames of a capture, without its labels.

    Parameters
    ----------
    name : str
        The source, as the user wrote it.
    path : Path
        Capture of any format that `asterism.read` knows.
    speed : float
        Multiple of real time; infinity for as fast as possible.
    """

    def __init__(self, name: str, path: Path, speed: float = 1.0) -> None:
        self.name, self._path, self._speed = name, path, speed
        self.rate = 0.0
        self.waits = math.isinf(speed)
        self.faults: dict[str, int] = {}
        self._capture: Capture | None = None
        self._next = 0
        self._begin = 0.0

    def open(self) -> None:
        """Read the capture and begin at its first frame.

        Raises
        ------
        SourceError
            If it cannot be read, or is 2-D.
        """
        try:
            capture = read(self._path)
        except FormatError as error:
            raise SourceError(str(error)) from error
        if capture.n_axes != 3:
            raise SourceError(f"{self._path}: expected a capture of 3-D points, found 2-D.")
        self.rate = round(1 / capture.step, 6) if capture.step else 0.0
        self._capture, self._next = capture, 0
        self._begin = time.perf_counter()

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        EndOfSource
            After the last frame.
        """
        d, t = self._capture, self._next
        if d is None or t == d.n_frames:
            raise EndOfSource(self.name)
        due = self._begin + float(d.times[t] - d.times[0]) / self._speed
        wait = due - time.perf_counter()
        if wait > timeout:
            time.sleep(timeout)
            return None
        if wait > 0:
            time.sleep(wait)
        self._next += 1
        rows = slice(int(d.offsets[t]), int(d.offsets[t + 1]))
        return SourceFrame(
            number=d.first_frame + t,
            time=float(d.times[t]),
            points=d.frame(t),
            received=time.perf_counter(),
            covariances=None if d.covariances is None else d.covariances[rows],
        )

    def close(self) -> None:
        """Forget the capture."""
        self._capture = None
