"""Progress of work whose number of parts is not known before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Halves"]


class Halves:
    """Progress of attempts at a capture, each of which is half of the work that is left.

    Parameters
    ----------
    n_frames : int
        Number of frames of the capture.
    progress : callable, optional
        Called with the number of finished frames of all the work.
    """

    def __init__(self, n_frames: int, progress: Callable[[int], Any] | None) -> None:
        self._n, self._progress, self._whole = n_frames, progress, 1

    def next(self) -> Callable[[int], None]:
        """Return the progress of the next attempt."""
        self._whole *= 2
        whole = self._whole

        def advance(done: int) -> None:
            if self._progress is not None:
                self._progress(((whole - 2) * self._n + done) // whole)

        return advance

    def end(self) -> None:
        """Report all frames as finished."""
        if self._progress is not None:
            self._progress(self._n)
