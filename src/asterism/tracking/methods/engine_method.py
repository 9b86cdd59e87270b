"""Base class of the methods whose loop over frames runs in the engine."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import field, replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism import _engine
from asterism.checks import check_kind
from asterism.errors import ParameterError, SolverLimit
from asterism.model import TrackingModel
from asterism.model.compiled import no_transition, steps_of, transition, with_noise
from asterism.records import record
from asterism.tracking.methods import options
from asterism.tracking.methods.base import Method, Update, checked_covariances, checked_frame
from asterism.tracking.methods.states import TrackStates, states_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from asterism.model import Detections

    Tracker = (
        _engine.FrameTracker
        | _engine.JointTracker
        | _engine.TreeTracker
        | _engine.HypothesisTracker
        | _engine.MatrixTracker
        | _engine.OneMotionTracker
        | _engine.SeveralMotionsTracker
    )

__all__ = ["EngineMethod", "EngineState"]

FRAMES_A_CALL = 1000
"""Number of frames of one call, small enough to report progress and to interrupt the run."""


@record(eq=False)
class EngineState:
    """State of a method in the engine.

    Parameters
    ----------
    model : TrackingModel
        Tracking model.
    n_axes : int
        Number of coordinates, 2 or 3.
    tracker : one of the engine's trackers
        Current tracks in the engine.
    about : callable
        Function that returns the method's counts of a frame or of all frames so far.
    prepared : list of trackers
        A copy of the tracker for the next step, if one was made in advance.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.GNN()
    >>> state, labels, _ = method.run(method.init(am.estimate_model(d).model), d)
    >>> state
    EngineState(3-D, 20 frames and 160 detections taken, 8 tracks so far)
    >>> state.n_ids, state.n_seen, state.info["tracks"]
    (8, 160, 8)
    >>> state.live()["means"].shape  # track, axis, and position or velocity
    (8, 3, 2)
    """

    model: TrackingModel
    n_axes: int
    tracker: Tracker
    about: Callable[[_engine.FrameStats], dict[str, float]]
    prepared: list[Tracker] = field(default_factory=list[Any])

    def __repr__(self) -> str:
        return (
            f"EngineState({self.n_axes}-D, {self.tracker.n_frames} frames and {self.n_seen} "
            f"detections taken, {self.n_ids} tracks so far)"
        )

    @property
    def n_ids(self) -> int:
        """Number of confirmed tracks so far."""
        return self.tracker.n_ids

    @property
    def n_seen(self) -> int:
        """Number of detections taken so far."""
        return self.tracker.n_seen

    @property
    def info(self) -> dict[str, float]:
        """Counts summed over all frames, and the largest of sizes and bounds."""
        return self.about(self.tracker.total)

    def live(self) -> dict[str, NDArray[Any]]:
        """Return the current confirmed tracks, for example for a display.

        Returns
        -------
        dict
            ``ids (k,)``, ``gaps (k,)`` frames since the last detection, ``log_odds (k,)`` that the
            marker exists, ``means (k, D, n)`` and ``covariances (k, n, n)`` of the state, SI units;
            with a χ² test also ``chi2 (k,)`` λ and ``updates (k,)`` detections so far.
        """
        names = ("ids", "gaps", "log_odds", "means", "covariances")
        live: dict[str, NDArray[Any]] = dict(zip(names, self.tracker.tracks(), strict=True))
        if isinstance(self.tracker, _engine.TreeTracker):
            live |= self.tracker.chi2()
        return live


@record
class EngineMethod(Method[EngineState]):
    """Method whose frames are processed by one of the engine's trackers.

    Examples
    --------
    A state is a value, so a stream can be forked, here into two continuations:

    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.GNN()
    >>> state = method.init(am.estimate_model(d).model)
    >>> half, _, _ = method.run(state, d.part(0, 10))
    >>> one, update = method.step(half, d.times[10], d.frame(10))
    >>> other, update = method.step(half, d.times[10], d.frame(10)[:4])
    >>> one.n_seen, other.n_seen
    (88, 84)
    """

    @abstractmethod
    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> Tracker:
        """Return the engine's tracker."""

    @abstractmethod
    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        """Return the counts of a frame or of a run of frames."""

    def init(
        self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None
    ) -> EngineState:
        """Return the state before the first frame.

        Parameters
        ----------
        model, n_axes, seed
            As for `Method.init`.

        Returns
        -------
        EngineState
        """
        if n_axes not in (2, 3):
            raise ParameterError("n_axes", "2 or 3", repr(n_axes))
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
        tracker = self._tracker(model, n_axes, seed)
        return EngineState(model=model, n_axes=n_axes, tracker=tracker, about=self._about)

    def step(
        self,
        state: EngineState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[EngineState, Update]:
        """Process the next frame.

        Parameters
        ----------
        state, time, points, covariances
            As for `Method.step`.

        Returns
        -------
        state, update
            Next state, and the labels decided by the frame.

        Raises
        ------
        ParameterError
            As for `Method.step`.
        SolverLimit
            If a gate contains too many detections for the memory.
        """
        return self.step_stitched(state, None, None, time, points, covariances)

    def step_stitched(
        self,
        state: EngineState,
        stitcher: _engine.LiveStitcher | None,
        before: _engine.LiveStitcher | None,
        time: float,
        points: ArrayLike,
        covariances: ArrayLike | None,
    ) -> tuple[EngineState, Update]:
        """Process the next frame as `step` does, and stitch its tracklets in the same call.

        Parameters
        ----------
        state, time, points, covariances
            As for `Method.step`.
        stitcher : LiveStitcher, optional
            Copy of `before` that is changed; it may have looked ahead. The update is that of the
            markers.
        before : LiveStitcher, optional
            Markers before the frame.

        Returns
        -------
        state, update
            As for `Method.step`.
        """
        check_kind("state", state, EngineState, "method.init(model)")
        tracker = state.prepared.pop() if state.prepared else state.tracker.copy()
        self._check(state, time, points)
        last_time = tracker.last_time
        frame = checked_frame(time, last_time, points, state.n_axes)
        if covariances is not None:
            frame = with_noise(frame, checked_covariances(covariances, frame))
        motion = state.model.motion
        # The first frame has no step before it and no tracks, so no transition is needed.
        is_first = last_time == -inf
        F, Q = no_transition(motion) if is_first else transition(motion, time - last_time)
        try:
            labels, sure, revised, revised_labels, revised_sure, stats = tracker.step(
                time, F, Q, frame, stitcher, before
            )
        except (_engine.CandidateLimit, _engine.FrontierLimit) as error:
            raise _too_many(error) from error
        # Records are made fastest with all fields.
        after = EngineState(
            model=state.model, n_axes=state.n_axes, tracker=tracker, about=state.about, prepared=[]
        )
        return after, Update(
            labels=labels, revised=revised, revised_labels=revised_labels, confidence=sure,
            revised_confidence=revised_sure, info=self._about(stats), names=None,
            read_tracks=partial(_tracks_of, tracker, stitcher),
        )  # fmt: skip

    def prepare(self, state: EngineState) -> None:
        """Copy the tracker for the next step; see `Method.prepare`."""
        if not state.prepared:
            state.prepared.append(state.tracker.copy())

    def _check(self, state: EngineState, time: float, points: ArrayLike) -> None:
        """Raise if the method cannot take the frame."""

    def run(
        self,
        state: EngineState,
        detections: Detections,
        *,
        progress: Callable[[int], Any] | None = None,
    ) -> tuple[EngineState, NDArray[np.int64], NDArray[np.float64] | None]:
        """Process all frames in the engine, with the same labels as a loop over `step`.

        Parameters
        ----------
        state, detections, progress
            As for `Method.run`.

        Returns
        -------
        state, labels, confidence
            Last state, label of every detection (N,), and confidences if the method estimates them.
        """
        check_kind("state", state, EngineState, "method.init(model)")
        points = with_noise(detections.points, detections.covariances)
        tracker = state.tracker.copy()
        times, offsets = detections.times, detections.offsets
        first = tracker.n_seen
        labels = np.full(first + detections.n_points, -1, dtype=np.int64)
        sure = np.zeros(len(labels) if tracker.has_confidence else 0)
        if detections.n_frames:
            checked_frame(float(times[0]), tracker.last_time, [], state.n_axes)
        # A state with earlier frames is continued from the last of them.
        n_before = min(tracker.n_frames, 1)
        known = np.concatenate([np.full(n_before, tracker.last_time), times])
        kind, F, Q = steps_of(state.model.motion, known)
        for t in range(0, detections.n_frames, FRAMES_A_CALL):
            end = min(t + FRAMES_A_CALL, detections.n_frames)
            some = points[offsets[t] : offsets[end]]
            starts = offsets[t : end + 1] - offsets[t]
            kinds = kind[n_before + t : n_before + end]
            try:
                tracker.run(times[t:end], kinds, F, Q, starts, some, labels, sure)
            except (_engine.CandidateLimit, _engine.FrontierLimit) as error:
                raise _too_many(error) from error
            if progress is not None:
                progress(end)
        confidence = sure[first:] if tracker.has_confidence else None
        after = replace(state, tracker=tracker, prepared=[])
        return after, labels[first:], confidence


def _tracks_of(tracker: Tracker, stitcher: _engine.LiveStitcher | None) -> TrackStates:
    return states_of(*tracker.tracks(stitcher))


def _too_many(error: Exception) -> SolverLimit:
    if isinstance(error, _engine.FrontierLimit):
        return SolverLimit(
            "tracks that compete at once",
            1025,
            1024,
            "reduce the gate by a larger gate.probability",
        )
    limit = options.MAX_CANDIDATES
    what = "pairs of track and detection within the gates of one frame"
    hint = "reduce the model's max_speed or noise_sigma, which is too large for points so dense"
    return SolverLimit(what, limit + 1, limit, hint)
