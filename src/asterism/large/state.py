"""Frames of a large scene before and after they are decided, and the state of its tracker."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from asterism.large.assignment import Assigned
    from asterism.large.tracks import LiveTracks

__all__ = ["DecidedFrame", "LargeState", "OpenFrame"]


@record(eq=False)
class OpenFrame:
    """Frame that is not yet decided.

    Attributes
    ----------
    number : int
        Number of the frame, from 0.
    time : float
        Time, seconds.
    F, Q : ndarray of shape (modes, n, n)
        Transition and process noise of the step that leads to it.
    points : ndarray of shape (N, D)
        Detections, metres.
    owners : ndarray of int64, shape (N,)
        Label of each detection, -1 for none, -2 - key for a tentative track.

    Examples
    --------
    >>> import numpy as np
    >>> one = np.ones((1, 1, 1))
    >>> OpenFrame(number=0, time=0.0, F=one, Q=one, points=np.zeros((4, 3)), owners=np.zeros(4))
    OpenFrame(number 0, 4 detections)
    """

    number: int
    time: float
    F: NDArray[np.float64]
    Q: NDArray[np.float64]
    points: NDArray[np.float64]
    owners: NDArray[np.int64]

    def __repr__(self) -> str:
        return f"OpenFrame(number {self.number}, {len(self.points)} detections)"


@record(eq=False)
class DecidedFrame:
    """Frame whose labels no longer change.

    Attributes
    ----------
    number : int
        Number of the frame, from 0.
    labels : ndarray of int64, shape (N,)
        Track of each detection, -1 for none.

    Examples
    --------
    >>> import numpy as np
    >>> DecidedFrame(number=0, labels=np.array([0, -1]))
    DecidedFrame(number=0, labels=[0, -1])
    """

    number: int
    labels: NDArray[np.int64]


@record(eq=False)
class LargeState:
    """State of a large tracker: current tracks and the frames that are not yet decided.

    Attributes
    ----------
    tracks : LiveTracks
        Current tracks.
    frames : tuple of OpenFrame
        Undecided frames, oldest first. The last `n_ahead` of them are not yet assigned.
    n_frames, n_ahead, n_keys, n_ids : int
        Frames taken, frames not yet assigned, tracks initiated, tracks confirmed.
    last : Assigned or None
        Assignment of the last frame, for its counts.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> am.large.LargeTracker(model=model).init()
    LargeState(0 frames taken, 0 undecided, 0 confirmed, 0 tentative)
    """

    tracks: LiveTracks
    frames: tuple[OpenFrame, ...] = ()
    n_frames: int = 0
    n_ahead: int = 0
    n_keys: int = 0
    n_ids: int = 0
    last: Assigned | None = None

    def __repr__(self) -> str:
        n = int(self.tracks.is_confirmed.sum())
        return (
            f"LargeState({self.n_frames} frames taken, {len(self.frames)} undecided, "
            f"{n} confirmed, {len(self.tracks) - n} tentative)"
        )
