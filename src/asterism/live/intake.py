"""Selection of the frames that are tracked: in order, in time, with finite points.

There is no buffer that sorts frames: it would delay every frame after a loss by several frames,
while a reordered frame costs no more than a lost one. A frame behind a later one is dropped.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from asterism.live.clock import SourceClock
    from asterism.live.faults import Faults
    from asterism.live.frame import SourceFrame

__all__ = ["Accepted", "Intake"]

LATE_FRAMES = 100
"""Number of frames by which a reordered frame is late at most; more is a restart."""
N_BACK = 12
"""Number of frames in a row with rising numbers behind the last one that are a restart."""
MAX_JUMP = 1.0
"""Seconds by which a time stamp may differ from the arrival before the clock counts as set."""
MAX_COORDINATE = 1e4
"""Largest coordinate of a point, metres."""
MAX_POINTS = 4096
"""Largest number of points of a frame."""
_MEMORY = 0.05  # weight of a new step in the estimate of the frame period


class Accepted(NamedTuple):
    """A frame to track.

    Attributes
    ----------
    frame : SourceFrame
        The frame, without the points that are not finite. Its time increases from frame to frame:
        after a restart of the source, it continues by the time between the arrivals.
    n_missing : int
        Number of frame periods without a frame before this one.
    """

    frame: SourceFrame
    n_missing: int


class Intake:
    """State of the checks of one source.

    Parameters
    ----------
    faults : Faults
        Receives what is wrong.
    clock : SourceClock
        Receives the times of the accepted frames.
    rate : float
        Nominal frame rate, Hz; 0 if unknown.
    in_real_time : bool
        Whether arrivals tell how much time has passed. A file that is read at full speed has none.
    """

    def __init__(
        self, faults: Faults, clock: SourceClock, *, rate: float = 0.0, in_real_time: bool = True
    ) -> None:
        self._faults, self._clock, self._in_real_time = faults, clock, in_real_time
        self.period = 1 / rate if rate > 0 else math.nan
        self._last: SourceFrame | None = None  # with the time of the source
        self._time = -math.inf  # of the stream
        self._shift = 0.0
        self._back: list[int] = []  # numbers of frames behind the last one
        self._n_dropped = 0

    def take(self, frame: SourceFrame) -> Accepted | None:
        """Check a frame.

        Parameters
        ----------
        frame : SourceFrame
            Frame as received.

        Returns
        -------
        Accepted or None
            None for a frame that is dropped.
        """
        frame = self._finite(frame)
        last = self._last
        if len(frame.points) > MAX_POINTS:
            self._faults.add("crowded", f"a frame has over {MAX_POINTS} points and is dropped")
            return None
        if last is None:
            if not math.isfinite(frame.time):
                self._faults.add("bad_times", "a time stamp is not a number")
                return None
            return self._accept(frame, frame.time, 0)
        if frame.number == last.number:
            self._faults.add("repeated", "a frame comes twice and is dropped")
            return None
        if frame.number < last.number:
            if not self._restarts(frame, last):
                self._faults.add("reordered", "a frame comes after a later one and is dropped")
                return None
            self._faults.add("restarts", "the source starts again; tracks continue")
            return self._accept(frame, self._by_arrival(frame, last), 0, is_new_clock=True)
        return self._follow(frame, last)

    def dropped(self, n: int) -> None:
        """Note that frames were dropped on this machine, which are not lost."""
        self._n_dropped += n

    def _follow(self, frame: SourceFrame, last: SourceFrame) -> Accepted:
        n_steps = frame.number - last.number
        step = frame.time - last.time
        if (n_lost := n_steps - 1 - self._n_dropped) > 0:
            self._faults.add("lost", "frames are missing", n_lost)
        # A frame may be dropped behind the one that is taken now.
        self._n_dropped = max(-n_lost, 0)
        period = self.period if math.isfinite(self.period) else 0.01
        if not math.isfinite(step) or -MAX_JUMP < step <= 0:
            self._faults.add("bad_times", "a time stamp does not advance; the frame rate is used")
            return self._accept(replace(frame, time=last.time + n_steps * period),
                                self._time + n_steps * period, n_steps - 1)  # fmt: skip
        # Frames that have waited arrive in a burst. Some of them may be dropped; their numbers say
        # how much time has passed.
        passed = max(frame.received - last.received, n_steps * period)
        if step <= -MAX_JUMP or (self._in_real_time and step > passed + MAX_JUMP):
            self._faults.add("clock_jumps", "the clock of the source jumps; arrivals are used")
            return self._accept(frame, self._by_arrival(frame, last), 0, is_new_clock=True)
        if n_steps == 1 or not math.isfinite(self.period):
            # A frame after a pause has a long step.
            each = step / n_steps
            if not math.isfinite(self.period):
                self.period = each
            elif each < 2 * self.period:
                self.period += _MEMORY * (each - self.period)
        return self._accept(frame, frame.time + self._shift, round(step / self.period) - 1)

    def _accept(
        self, frame: SourceFrame, time: float, n_missing: int, *, is_new_clock: bool = False
    ) -> Accepted:
        if is_new_clock:
            n_missing = round((time - self._time) / self.period) - 1 if self.period > 0 else 0
            self._shift = time - frame.time
            self._clock.reset()
        self._clock.add(frame.time, frame.received)
        self._last, self._time = frame, time
        self._back = []
        if time != frame.time:
            frame = replace(frame, time=time)
        return Accepted(frame, max(n_missing, 0))

    def _by_arrival(self, frame: SourceFrame, last: SourceFrame) -> float:
        """Return the time of the stream by the time since the last arrival."""
        period = self.period if math.isfinite(self.period) else 0.01
        waited = frame.received - last.received if self._in_real_time else 0.0
        return self._time + max(waited, period)

    def _restarts(self, frame: SourceFrame, last: SourceFrame) -> bool:
        """Return whether a frame behind the last one belongs to a source that has restarted."""
        back = self._back
        if back and not 0 < frame.number - back[-1] <= LATE_FRAMES:
            back.clear()
        back.append(frame.number)
        is_far = last.number - frame.number > LATE_FRAMES or frame.time < last.time - MAX_JUMP
        return len(back) >= (2 if is_far else N_BACK)

    def _finite(self, frame: SourceFrame) -> SourceFrame:
        points = frame.points
        flat = points.reshape(-1)
        if flat.dot(flat) <= MAX_COORDINATE**2:  # faster than to look at each
            return frame
        kept = (np.abs(points) <= MAX_COORDINATE).all(axis=1)
        if kept.all():
            return frame
        # Systems send NaN for a marker that they do not see.
        if n_bad := int((~kept & ~np.isnan(points).any(axis=1)).sum()):
            reason = f"a point is infinite or beyond {MAX_COORDINATE:g} m and is dropped"
            self._faults.add("bad_points", reason, n_bad)
        own = None if frame.covariances is None else frame.covariances[kept]
        return replace(frame, points=points[kept], covariances=own)
