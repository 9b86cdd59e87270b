"""Interface of every method: `init` makes a state, `step` processes the next frame.

A state is a value: `step` returns a new one and leaves the old one unchanged, so a run can be
forked or resumed from an earlier frame. `run` is equivalent to a loop over `step`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import field
from functools import cached_property
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from asterism.checks import check_array, check_kind, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from asterism.model import Detections, TrackingModel
    from asterism.tracking.methods.states import TrackStates

__all__ = ["Method", "MethodState", "Update", "checked_covariances", "checked_frame"]


@runtime_checkable
class MethodState(Protocol):
    """Properties of the state of every method.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> state = am.GNN().init(am.estimate_model(d).model)
    >>> state.n_seen, state.info["tracks"]
    (0, 0)
    """

    @property
    def n_seen(self) -> int:
        """Number of detections processed so far."""
        ...

    @property
    def info(self) -> Mapping[str, float]:
        """Counts of the run so far, including the sizes of approximations."""
        ...


State = TypeVar("State", bound=MethodState)

_FLOAT = np.dtype(np.float64)  # there is one such object in a process


def _nothing() -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


@record(eq=False)
class Update:
    """Labels decided or revised by one frame.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Current track of each point of the frame; -1 for clutter or a tentative track. A tentative
        track gets its label at confirmation, by `revised`.
    revised : ndarray of int, shape (r,)
        Earlier detections whose label changes, numbered from 0 in order of arrival.
    revised_labels : ndarray of int, shape (r,)
        New labels of these detections.
    confidence : ndarray of shape (n,), or None
        Probability that each label is right, if the method estimates it.
    revised_confidence : ndarray of shape (r,), or None
        Probability that each revised label is right.
    info : mapping
        Counts of the step, such as tracks, groups and candidates.
    names : tuple of (str or None), or None
        Name of the marker of each point, if the method names tracks (`Named`).
    read_tracks : callable, optional
        Computes `tracks` at its first use, from the state after the frame. It refers to that state,
        which is kept as long as the update.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.GNN()
    >>> state = method.init(am.estimate_model(d).model)
    >>> for time, points in d:
    ...     state, update = method.step(state, time, points)
    >>> update
    Update(8 detections, 8 in tracks, 0 earlier labels revised)
    >>> update.labels.tolist(), update.tracks
    ([0, 1, 2, 3, 4, 5, 6, 7], TrackStates(8 tracks, 0 occluded))
    """

    labels: NDArray[np.int64]
    revised: NDArray[np.int64] = field(default_factory=_nothing)
    revised_labels: NDArray[np.int64] = field(default_factory=_nothing)
    confidence: NDArray[np.float64] | None = None
    revised_confidence: NDArray[np.float64] | None = None
    info: Mapping[str, float] = field(default_factory=dict[str, float])
    names: tuple[str | None, ...] | None = None
    read_tracks: Callable[[], TrackStates | None] | None = None

    @cached_property
    def tracks(self) -> TrackStates | None:
        """States of the tracks after the frame; None if the method does not report them."""
        return None if self.read_tracks is None else self.read_tracks()

    def __repr__(self) -> str:
        sure = "" if self.confidence is None else ", with confidence"
        return (
            f"Update({len(self.labels)} detections, {int((self.labels >= 0).sum())} in tracks, "
            f"{len(self.revised)} earlier labels revised{sure})"
        )


class Method(ABC, Generic[State]):
    """Method of association, which assigns detections to tracks frame by frame.

    A method of your own derives from this class, with `name`, `init` and `step`; `run` and
    `asterism.track` then work with it.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.tracking.method_by_name("gnn")
    >>> state = method.init(am.estimate_model(d).model, n_axes=d.n_axes)
    >>> state, update = method.step(state, d.times[0], d.frame(0))
    >>> state, labels, confidence = method.run(state, d.part(1, d.n_frames))
    >>> int(labels.max()) + 1
    8
    """

    name: ClassVar[str]
    """Name of the method on the command line."""

    @abstractmethod
    def init(self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None) -> State:
        """Return the state before the first frame.

        Parameters
        ----------
        model : TrackingModel
            Model whose posterior is searched.
        n_axes : int
            Number of coordinates, 2 or 3.
        seed : int, optional
            Seed of the methods that draw random numbers, 0 by default; the others ignore it.

        Returns
        -------
        State

        Raises
        ------
        ParameterError
            If an argument has the wrong type, or `n_axes` is neither 2 nor 3.
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
        """Process the next frame.

        Parameters
        ----------
        state : State
            State from `init` or the previous step; it is not changed.
        time : float
            Time of the frame, seconds, later than the previous frame.
        points : array_like of shape (n, D)
            Points of the frame, metres; may be empty.
        covariances : array_like of shape (n, D, D), optional
            Covariance of each point, m², added to the sensor's noise. Its mean variance over the
            axes is used, because a track has one variance for all axes.

        Returns
        -------
        state, update
            Next state, and the labels decided by the frame.

        Raises
        ------
        ParameterError
            If the state belongs to another method, the time does not advance, or the points are
            not finite numbers.
        """

    def prepare(self, state: State) -> None:
        """Do what the next `step` from a state needs and does not depend on its frame.

        A loop that waits for frames calls it meanwhile, so that the next frame takes less time. It
        changes no result; by default there is nothing to prepare.

        Parameters
        ----------
        state : State
            State from `init` or a step.
        """

    def run(
        self,
        state: State,
        detections: Detections,
        *,
        progress: Callable[[int], Any] | None = None,
    ) -> tuple[State, NDArray[np.int64], NDArray[np.float64] | None]:
        """Process all frames of `detections`, equivalent to a loop over `step` with its revisions.

        Parameters
        ----------
        state : State
            State from `init`, or from an earlier call, which is then continued.
        detections : Detections
            Frames to process, later than those of the state.
        progress : callable, optional
            Called from time to time with the number of finished frames.

        Returns
        -------
        state, labels, confidence
            Last state, label of every detection (N,), and confidences if the method estimates
            them.
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
    """Check one frame of a stream and return its points as an (n, D) array.

    Parameters
    ----------
    time : float
        Time of the frame, seconds.
    last_time : float
        Time of the previous frame, seconds; -inf before the first.
    points : array_like of shape (n, D)
        Points of the frame, metres; may be empty.
    n_axes : int
        Number of coordinates D, 2 or 3.

    Returns
    -------
    ndarray of shape (n, D)

    Raises
    ------
    ParameterError
        If the time does not advance or the points are not finite (n, D) numbers.

    Examples
    --------
    >>> checked_frame(0.01, 0.0, [[0, 0, 1]], 3)
    array([[0., 0., 1.]])
    >>> checked_frame(0.01, 0.01, [[0, 0, 1]], 3)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: time: expected later than the frame before (0.01 s), found 0.01
    s. Sort the frames by time and drop repeated ones.
    """
    if not (type(time) is float and last_time < time < inf):
        check_number("time", time)
    if time <= last_time:
        raise ParameterError(
            "time",
            f"later than the frame before ({last_time:g} s)",
            f"{time:g} s",
            "sort the frames by time and drop repeated ones",
        )
    array = np.asarray(points)
    if array.dtype is _FLOAT and array.shape[1:] == (n_axes,) and array.flags.c_contiguous:
        flat = array.reshape(-1)
        if isfinite(flat.dot(flat)):  # faster than the check below, which says what is wrong
            return array
    if array.size == 0:
        return np.empty((0, n_axes))
    return check_array("points", array, ("n", n_axes))


def checked_covariances(covariances: ArrayLike, frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """Check the covariances of a frame's points and return them.

    Parameters
    ----------
    covariances : array_like of shape (n, D, D)
        Covariance of each point, m².
    frame : ndarray of shape (n, D)
        Points of the frame, metres.

    Returns
    -------
    ndarray of shape (n, D, D)

    Raises
    ------
    ParameterError
        If they are not finite matrices, one for each point, or a variance is negative.

    Examples
    --------
    >>> checked_covariances([[[1e-6, 0], [0, 1e-6]]], np.zeros((1, 2))).shape
    (1, 2, 2)
    """
    n, D = frame.shape
    array = np.asarray(covariances, dtype=np.float64)
    if array.size == 0 and n == 0:
        return np.empty((0, D, D))
    array = check_array("covariances", array, (n, D, D))
    if (np.diagonal(array, axis1=1, axis2=2) < 0).any():
        raise ParameterError("covariances", "variances ≥ 0", "a negative one")
    return array
