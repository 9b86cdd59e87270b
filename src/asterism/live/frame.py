"""Frames of a stream: as a source delivers them, and as the tracker hands them to the sinks."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from asterism.tracking.methods.states import TrackStates

__all__ = ["LiveFrame", "SourceFrame", "StreamHeader"]


@record(eq=False)
class SourceFrame:
    """One frame as a source delivers it.

    Parameters
    ----------
    number : int
        Frame number of the source.
    time : float
        Time of the frame by the clock of the source, seconds.
    points : ndarray of shape (N, 3)
        Unlabelled points, metres. They are passed on as received and may hold NaN.
    received : float
        `time.perf_counter` at the reception of the last byte, seconds.
    covariances : ndarray of shape (N, 3, 3), optional
        Covariance of each point, m².

    Examples
    --------
    >>> import numpy as np
    >>> SourceFrame(number=12, time=0.12, points=np.zeros((5, 3)), received=33.5)
    SourceFrame(number=12, time=0.12, points=array (5, 3), received=33.5)
    """

    number: int
    time: float
    points: NDArray[np.float64]
    received: float
    covariances: NDArray[np.float64] | None = None


@record(eq=False)
class StreamHeader:
    """Facts about a stream that a sink needs before the first frame.

    Parameters
    ----------
    source : str
        Source, as the user wrote it.
    rate : float
        Nominal frame rate, Hz; 0 if it is unknown.
    names : tuple of str
        Names of the markers that may occur, in the order of the marker set; empty without one.

    Examples
    --------
    >>> StreamHeader(source="qtm://127.0.0.1", rate=240.0, names=("LASI", "RASI"))
    StreamHeader(source='qtm://127.0.0.1', rate=240, names=('LASI', 'RASI'))
    """

    source: str
    rate: float = 0.0
    names: tuple[str, ...] = ()


@record(eq=False)
class LiveFrame:
    """One frame after tracking, as every sink receives it.

    Parameters
    ----------
    number : int
        Frame number of the source.
    time : float
        Time of the frame by the clock of the source, seconds.
    points : ndarray of shape (N, 3)
        Points of the frame, metres.
    labels : ndarray of int, shape (N,)
        Identity of the track of each point, as in `tracks.ids`; -1 for clutter.
    names : tuple of (str or None), optional
        Marker name of each point, None if it is unknown.
    read_tracks : callable, optional
        Computes `tracks` at its first use, from the state of the tracker after the frame, which is
        kept as long as the frame. A sink uses `tracks` within `send`, in the thread of the loop.
    received, done : float
        `time.perf_counter` at the reception of the frame and after its tracking, seconds.

    Examples
    --------
    >>> import numpy as np
    >>> LiveFrame(number=1, time=0.01, points=np.zeros((2, 3)), labels=np.array([0, -1]))
    LiveFrame(number=1, time=0.01, points=array (2, 3), labels=[0, -1])
    """

    number: int
    time: float
    points: NDArray[np.float64]
    labels: NDArray[np.int64]
    names: tuple[str | None, ...] | None = None
    read_tracks: Callable[[], TrackStates | None] | None = None
    received: float = 0.0
    done: float = 0.0

    @cached_property
    def tracks(self) -> TrackStates | None:
        """States of all tracks, occluded ones included; None if there are none."""
        return None if self.read_tracks is None else self.read_tracks()
