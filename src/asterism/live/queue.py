"""Bounded queue between the thread that receives and the thread that tracks."""

from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue
from time import sleep
from typing import TYPE_CHECKING, Any

from asterism.live.frame import SourceFrame

if TYPE_CHECKING:
    from threading import Event

__all__ = ["FrameQueue"]

_PAUSE = 0.0005  # seconds, between two looks for a free place


class FrameQueue:
    """Frames and events in the order of their arrival, at most so many frames.

    Parameters
    ----------
    size : int
        Largest number of waiting items.
    waits : bool
        Whether a full queue stops the source, which can wait. Otherwise the oldest frame is
        dropped; events, such as the end of the source, are never dropped.

    Examples
    --------
    >>> import numpy as np
    >>> queue = FrameQueue(2, waits=False)
    >>> for number in range(3):
    ...     frame = SourceFrame(number=number, time=0.0, points=np.zeros((0, 3)), received=0.0)
    ...     queue.put(frame)
    >>> queue.get(0.0).number, queue.n_dropped
    (1, 1)
    """

    def __init__(self, size: int, *, waits: bool) -> None:
        self._items: SimpleQueue[Any] = SimpleQueue()
        self._events: deque[Any] = deque()
        self._size, self._waits = size, waits
        self.n_dropped = 0

    def put(self, item: Any, stop: Event | None = None) -> None:
        """Add a frame or an event.

        Parameters
        ----------
        item : SourceFrame or event
            What is added.
        stop : Event, optional
            Ends the wait for a free place; the item is then lost.
        """
        while isinstance(item, SourceFrame) and self._items.qsize() >= self._size:
            if self._waits:
                if stop is not None and stop.is_set():
                    return
                sleep(_PAUSE)
                continue
            try:
                oldest = self._items.get_nowait()
            except Empty:
                break
            if isinstance(oldest, SourceFrame):
                self.n_dropped += 1
            else:
                self._events.append(oldest)
        self._items.put(item)

    def get(self, timeout: float) -> Any:
        """Return the next frame or event, None after `timeout` seconds without one."""
        if self._events:
            return self._events.popleft()
        try:
            return self._items.get(timeout=timeout) if timeout > 0 else self._items.get_nowait()
        except Empty:
            return None

    def __len__(self) -> int:
        """Return the number of waiting items."""
        return self._items.qsize() + len(self._events)
