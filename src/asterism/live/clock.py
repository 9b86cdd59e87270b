"""Clock of a source against the clock of this machine."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

__all__ = ["SourceClock"]

_WINDOW = 1.0  # seconds, of which the frame with the shortest delay counts
_N_WINDOWS = 60
_MIN_WINDOWS = 5


class SourceClock:
    """Line through source time and arrival time, robust against delays.

    A delay makes a frame late and never early. The earliest frame of each second is therefore
    kept, and the line is the median of the slopes of all pairs of the last 60 of them (Theil and
    Sen). A stall of less than half of this time does not change the slope.

    Examples
    --------
    >>> clock = SourceClock()
    >>> for frame in range(2000):
    ...     time = frame / 100
    ...     clock.add(time, 5 + 1.0001 * time + (0.01 if frame % 3 else 0))
    >>> round(clock.drift, 6)
    0.0001
    """

    def __init__(self) -> None:
        self._kept: deque[tuple[float, float]] = deque(maxlen=_N_WINDOWS)  # time, offset
        self._end = -math.inf
        self._best: tuple[float, float] | None = None

    def add(self, time: float, received: float) -> None:
        """Take the times of a frame.

        Parameters
        ----------
        time : float
            Time by the clock of the source, seconds.
        received : float
            Time of the arrival by the clock of this machine, seconds.
        """
        if received >= self._end:
            if self._best is not None:
                self._kept.append(self._best)
            self._best, self._end = None, received + _WINDOW
        offset = received - time
        if self._best is None or offset < self._best[1]:
            self._best = (time, offset)

    def reset(self) -> None:
        """Forget all frames, after a jump of the clock."""
        self._kept.clear()
        self._best = None

    @property
    def drift(self) -> float:
        """Seconds that this machine's clock gains in a second of the source; nan if unknown."""
        if len(self._kept) < _MIN_WINDOWS:
            return math.nan
        time, offset = np.array(self._kept).T
        first, second = np.triu_indices(len(time), 1)
        apart = time[second] - time[first]
        slopes = (offset[second] - offset[first])[apart > 0] / apart[apart > 0]
        return float(np.median(slopes)) if len(slopes) else math.nan
