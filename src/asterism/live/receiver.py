"""Thread that receives the frames of a source, and connects again when the connection is lost."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, NamedTuple

from asterism.errors import SourceError, SourceLost
from asterism.live.sources.base import EndOfSource

if TYPE_CHECKING:
    from asterism.live.queue import FrameQueue
    from asterism.live.sources.base import Source

__all__ = ["Connected", "Disconnected", "Ended", "Receiver"]

_LOOK = 0.1  # seconds, after which a stop is noticed
FIRST_WAIT, LONGEST_WAIT = 0.25, 8.0
"""Seconds before the first attempt to connect again, and the longest after further failures."""


class Disconnected(NamedTuple):
    """The connection is gone; the reason is `message`."""

    message: str


class Connected(NamedTuple):
    """The source is connected again, after `n_attempts` attempts."""

    n_attempts: int


class Ended(NamedTuple):
    """There are no further frames: the source has ended, or failed by `error`."""

    error: Exception | None = None


class Receiver(threading.Thread):
    """Moves frames from an open source to the queue.

    Parameters
    ----------
    source : Source
        Source, already open. It is closed at the end.
    queue : FrameQueue
        Receives frames and events.
    stop : Event
        Ends the thread.
    """

    def __init__(self, source: Source, queue: FrameQueue, stop: threading.Event) -> None:
        super().__init__(name="receiver", daemon=True)
        self._source, self._queue, self._ending = source, queue, stop

    def run(self) -> None:
        """Receive until the source ends or the loop stops."""
        error: Exception | None = None
        try:
            while not self._ending.is_set():
                try:
                    frame = self._source.receive(_LOOK)
                except SourceLost as lost:
                    self._queue.put(Disconnected(str(lost)))
                    if not self._connect_again():
                        break
                    continue
                if frame is not None:
                    self._queue.put(frame, self._ending)
        except EndOfSource:
            pass
        except Exception as failure:  # the loop raises it in its own thread
            error = failure
        finally:
            self._source.close()
            self._queue.put(Ended(error))

    def _connect_again(self) -> bool:
        """Open the source again; return whether it is open."""
        wait, n_attempts = FIRST_WAIT, 0
        while True:
            self._source.close()
            if self._ending.wait(wait):
                return False
            n_attempts += 1
            try:
                self._source.open()
            except SourceError:
                wait = min(2 * wait, LONGEST_WAIT)
                continue
            self._queue.put(Connected(n_attempts))
            return True
