"""The contract of sinks: what the loop of a stream expects of each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from asterism.live.frame import LiveFrame, StreamHeader

__all__ = ["Sink"]


class Sink(Protocol):
    """A receiver of tracked frames.

    Attributes
    ----------
    name : str
        The sink, as the user wrote it.
    faults : dict of str to int
        Number of frames that were dropped, by reason.
    """

    name: str
    faults: dict[str, int]

    def open(self, header: StreamHeader) -> None:
        """Begin.

        Parameters
        ----------
        header : StreamHeader
            Facts about the stream.

        Raises
        ------
        SinkError
            If the port, the file or the other side is not available.
        """
        ...

    def send(self, frame: LiveFrame) -> None:
        """Pass on a frame, without waiting for a slow receiver: frames that it misses are counted.

        Parameters
        ----------
        frame : LiveFrame
            The frame.
        """
        ...

    def close(self) -> None:
        """End and finish files; has no effect on a sink that is not open."""
        ...
