"""Reception of the frames of a source, and new attempts when the connection is lost."""

from __future__ import annotations

import logging
import threading
from collections import deque
from typing import TYPE_CHECKING

from asterism.errors import SourceError, SourceLost

if TYPE_CHECKING:
    from asterism.live.faults import Faults
    from asterism.live.frame import SourceFrame
    from asterism.live.sources.base import Source

__all__ = ["Receiver"]

log = logging.getLogger(__name__)

QUEUE = 256
"""Number of frames that wait at most."""
FIRST_WAIT, LONGEST_WAIT = 0.25, 8.0
"""Seconds before the first attempt to connect again, and the longest after further failures."""


class Receiver:
    """Frames of an open source, which are received by the thread that asks for them.

    A frame is thus decoded and tracked on the same core, without a hand-over. A lost connection is
    opened again in another thread, because that can take seconds.

    Parameters
    ----------
    source : Source
        Source, already open.
    faults : Faults
        Receives the losses of the connection.

    Attributes
    ----------
    n_dropped : int
        Number of frames that were dropped because over `QUEUE` waited.
    """

    def __init__(self, source: Source, faults: Faults) -> None:
        self._source, self._faults = source, faults
        self._waiting: deque[SourceFrame] = deque()
        self._error: Exception | None = None
        self._opening: threading.Thread | None = None
        self._ending = threading.Event()
        self.n_dropped = 0

    def __len__(self) -> int:
        """Return the number of frames that wait."""
        return len(self._waiting)

    def next(self, timeout: float) -> SourceFrame | None:
        """Return the next frame, None after `timeout` seconds without one.

        Raises
        ------
        EndOfSource
            If a source that ends has no further frame.
        """
        if self._waiting:
            return self._waiting.popleft()
        return self._received(timeout)

    def collect(self) -> int:
        """Receive the frames that have arrived meanwhile; return the number of frames that wait.

        The oldest frames are dropped beyond `QUEUE`. A source that waits keeps its frames itself.
        """
        if self._source.waits:
            return 0
        for _ in range(QUEUE):
            try:
                frame = self._received(0.0)
            except Exception as error:  # `next` raises it after the frames before
                self._error = error
                break
            if frame is None:
                break
            self._waiting.append(frame)
            if len(self._waiting) > QUEUE:
                self._waiting.popleft()
                self.n_dropped += 1
        return len(self._waiting)

    def close(self) -> None:
        """End the attempts to connect again, and close the source."""
        self._ending.set()
        if self._opening is not None:
            self._opening.join(2.0)
        self._source.close()

    def _received(self, timeout: float) -> SourceFrame | None:
        if self._opening is not None:
            self._opening.join(timeout)
            if self._opening.is_alive():
                return None
            self._opening = None
        if self._error is not None:
            raise self._error
        try:
            return self._source.receive(timeout)
        except SourceLost as lost:
            self._faults.add("disconnects", f"{lost} It is connected again when it can")
            self._opening = threading.Thread(target=self._open_again, name="opening", daemon=True)
            self._opening.start()
            return None

    def _open_again(self) -> None:
        """Open the source again."""
        wait = FIRST_WAIT
        self._source.close()
        while not self._ending.wait(wait):
            try:
                self._source.open()
            except SourceError:
                wait = min(2 * wait, LONGEST_WAIT)
                continue
            except Exception as error:  # `next` raises it in the thread of the loop
                self._error = error
            else:
                log.info("%s: connected again", self._source.name)
            break
        if self._ending.is_set():  # `close` does not wait for long
            self._source.close()
