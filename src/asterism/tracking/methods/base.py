"""The contract of every method: `init` makes a state, `step` takes the next frame.

A state is a value: `step` gives a new one and leaves the old one as it was, so a run can be forked
or taken back. `run` is the same over many frames.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from asterism.checks import check_array, check_kind, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from asterism.model import Detections, TrackingModel

__all__ = ["Method", "MethodState", "Update", "checked_covariances", "checked_frame"]


@runtime_checkable
class MethodState(Protocol):
    """What every method's state tells."""

    @property
    def n_seen(self) -> int:
        """Number of detections taken so far."""
        ...

    @property
    def info(self) -> Mapping[str, float]:
        """Numbers about the run so far; what was approximated, and by how much, among them."""
        ...


State = TypeVar("State", bound=MethodState)


def _nothing() -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


@record(eq=False)
class Update:
    """What one frame decided.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Track of each point of the frame as known now; -1 for clutter or not yet believed.
    revised : ndarray of int, shape (r,)
        Earlier detections whose label changes, numbered from 0 in order of arrival.
    revised_labels : ndarray of int, shape (r,)
        Their labels.
    confidence : ndarray, shape (n,), or None
        Probability that each label is right, from methods that know it.
    revised_confidence : ndarray, shape (r,), or None
        The same of the revised labels.
    info : mapping
        Numbers about the step: counts of tracks, groups, candidates.
    """

    labels: NDArray[np.int64]
    revised: NDArray[np.int64] = field(default_factory=_nothing)
    revised_labels: NDArray[np.int64] = field(default_factory=_nothing)
    confidence: NDArray[np.float64] | None = None
    revised_confidence: NDArray[np.float64] | None = None
    info: Mapping[str, float] = field(default_factory=dict[str, float])

    def __repr__(self) -> str:
        sure = "" if self.confidence is None else ", with confidence"
        return (
            f"Update({len(self.labels)} detections, {int((self.labels >= 0).sum())} in tracks, "
            f"{len(self.revised)} earlier labels revised{sure})"
        )


class Method(ABC, Generic[State]):
    """A way of telling which detection is which marker."""

    name: ClassVar[str]
    """The method's name on the command line."""

    @abstractmethod
    def init(self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None) -> State:
        """Make the state before the first frame.

        Parameters
        ----------
        model : TrackingModel
            The model that is searched.
        n_axes : int
            2 or 3 coordinates.
        seed : int, optional
            For the methods that draw; the others give the same whatever it is.
        """

    @abstractmethod
    def step(
        self,
        state: State,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[State, Update]:
        """Take the next frame.

        Parameters
        ----------
        state : State
            From `init` or the step before; it is not changed.
        time : float
            Seconds, later than the frame before.
        points : array_like, shape (n, D)
            Metres; may be empty.
        covariances : array_like, shape (n, D, D), optional
            Of the points, m²: noise that is theirs beyond the sensor's. Tracks have one variance
            for all axes, so the mean over the axes is taken.

        Returns
        -------
        state, update
            The next state and what was decided.

        Raises
        ------
        ParameterError
            If the state is none of this method's, the time does not advance, or the points are
            not finite numbers.
        """

    def run(
        self,
        state: State,
        detections: Detections,
        *,
        progress: Callable[[int], Any] | None = None,
    ) -> tuple[State, NDArray[np.int64], NDArray[np.float64] | None]:
        """Take all frames of `detections`: the loop over `step`, with its revisions applied.

        Parameters
        ----------
        state : State
            From `init`.
        detections : Detections
            The frames.
        progress : callable, optional
            Called now and then with the number of frames done.

        Returns
        -------
        state, labels, confidence
            The last state, the label of every detection (N,), and the confidences if the method
            has any.
        """
        check_kind("state", state, MethodState, "method.init(model)")
        first = state.n_seen
        labels = np.full(first + detections.n_points, -1, dtype=np.int64)
        confidence: NDArray[np.float64] | None = None
        noise = detections.covariances
        for t, (time, points) in enumerate(detections):
            a, b = detections.offsets[t], detections.offsets[t + 1]
            own = None if noise is None else noise[a:b]
            state, update = self.step(state, time, points, covariances=own)
            frame = slice(first + a, first + b)
            labels[frame] = update.labels
            labels[update.revised] = update.revised_labels
            if update.confidence is not None:
                if confidence is None:
                    confidence = np.zeros(len(labels))
                confidence[frame] = update.confidence
                if update.revised_confidence is not None:
                    confidence[update.revised] = update.revised_confidence
            if progress is not None:
                progress(t + 1)
        return state, labels[first:], None if confidence is None else confidence[first:]


def checked_frame(
    time: float, last_time: float, points: ArrayLike, n_axes: int
) -> NDArray[np.float64]:
    """Check one frame of a stream and give its points as an (n, D) array.

    Raises
    ------
    ParameterError
        If the time does not advance or the points are not finite (n, D) numbers.
    """
    check_number("time", time)
    if time <= last_time:
        raise ParameterError(
            "time",
            f"later than the frame before ({last_time:g} s)",
            f"{time:g} s",
            "frames must come in order; drop repeated ones",
        )
    array = np.asarray(points)
    if array.size == 0:
        return np.empty((0, n_axes))
    return check_array("points", array, ("n", n_axes))


def checked_covariances(covariances: ArrayLike, frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """Check the covariances of a frame's points.

    Raises
    ------
    ParameterError
        If they are not finite matrices, one for each point, or a variance is negative.
    """
    n, D = frame.shape
    array = np.asarray(covariances, dtype=np.float64)
    if array.size == 0 and n == 0:
        return np.empty((0, D, D))
    array = check_array("covariances", array, (n, D, D))
    if (np.diagonal(array, axis1=1, axis2=2) < 0).any():
        raise ParameterError("covariances", "variances ≥ 0", "a negative one")
    return array
