"""The contract of sources: what the loop of a stream expects of each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from asterism.live.frame import SourceFrame

__all__ = ["EndOfSource", "Source"]


class EndOfSource(Exception):
    """A source that ends, such as a file, has delivered all of its frames."""


class Source(Protocol):
    """A stream of frames of unlabelled points.

    A source decodes and converts to metres. It neither sorts nor filters frames: lost, repeated and
    reordered frames are the loop's concern.

    Attributes
    ----------
    name : str
        The source, as the user wrote it.
    rate : float
        Nominal frame rate, Hz; 0 while it is unknown.
    waits : bool
        Whether the source waits while tracking is behind, as a file does. Otherwise late frames are
        dropped.
    faults : dict of str to int
        Number of packets that could not be decoded and were ignored, as `Faults.undecoded` counts.
    """

    name: str
    rate: float
    waits: bool
    faults: dict[str, int]

    def open(self) -> None:
        """Connect; a source that is closed may be opened again.

        Raises
        ------
        SourceError
            If the source cannot be reached, or refuses.
        """
        ...

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Parameters
        ----------
        timeout : float
            Longest wait, seconds.

        Returns
        -------
        SourceFrame or None
            None if no frame arrived in time.

        Raises
        ------
        SourceLost
            If the connection is gone; `open` connects again.
        EndOfSource
            If a source that ends has no further frame.
        """
        ...

    def close(self) -> None:
        """Disconnect; has no effect on a source that is not open."""
        ...
