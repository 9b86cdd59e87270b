"""Stitching frame by frame, for streams, through gaps of any length."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from asterism import _engine
from asterism.checks import check_kind, check_number
from asterism.model import TrackingModel
from asterism.model.compiled import motion_model, no_transition, transition
from asterism.records import record
from asterism.tracking.methods import SMP, Method, TrackStates, Update
from asterism.tracking.methods.base import MethodState, checked_frame
from asterism.tracking.methods.engine_method import EngineMethod, EngineState
from asterism.tracking.methods.states import states_of
from asterism.tracking.stitching.tracklets import tracklet_model
from asterism.tracking.stitching.whole import check_options, stitch_options

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Stitched", "StitchedState"]


@record(eq=False)
class StitchedState:
    """State of `Stitched`: the tracklets of its method, and the markers they belong to.

    Parameters
    ----------
    tracklets : MethodState
        State of the method that tracks the tracklets.
    stitcher : LiveStitcher
        Markers in the engine.
    model : TrackingModel
        Model of the tracklets.
    n_axes : int
        Number of coordinates, 2 or 3.
    last_time : float
        Time of the last frame, seconds; -inf before the first.
    prepared : list of LiveStitcher
        A copy of the stitcher for the next step that has looked ahead, if one was made.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.tracking.Stitched()
    >>> state, labels, _ = method.run(method.init(am.estimate_model(d).model), d)
    >>> state
    StitchedState(3-D, 160 detections taken, 0 joins, 0 cuts, 0 ghosts)
    >>> state.n_seen, state.info["joins"]
    (160, 0)
    """

    tracklets: MethodState
    stitcher: _engine.LiveStitcher
    model: TrackingModel
    n_axes: int
    last_time: float = float("-inf")
    prepared: list[_engine.LiveStitcher] = field(default_factory=list[_engine.LiveStitcher])

    def __repr__(self) -> str:
        stitcher = self.stitcher
        return (
            f"StitchedState({self.n_axes}-D, {self.n_seen} detections taken, "
            f"{stitcher.n_joins} joins, {stitcher.n_cuts} cuts, {stitcher.n_ghosts} ghosts)"
        )

    @property
    def n_seen(self) -> int:
        """Number of detections processed so far."""
        return self.stitcher.n_seen

    @property
    def info(self) -> dict[str, float]:
        """Counts of the method, and of the joins, cuts and ghosts of the stitching."""
        return {
            **self.tracklets.info,
            "joins": self.stitcher.n_joins,
            "cuts": self.stitcher.n_cuts,
            "ghosts": self.stitcher.n_ghosts,
        }


def _over_three_frames() -> Method[Any]:
    return SMP(window=3)


@record
class Stitched(Method[StitchedState]):
    """Method for streams that stitches the tracklets of another method frame by frame.

    It corresponds to `stitch` for a whole capture, with the frames so far. A reappearing marker
    gets its most probable label when the method has confirmed its tracklet and `lag` frames have
    passed. The label is final after `confirm` detections, and earlier detections are revised. A
    marker that was never detected before has the label -1 until then.

    Parameters
    ----------
    method : Method
        Method that tracks the tracklets; `SMP` over three frames by default.
    confirm : int
        Number of frames after which a tracklet is assigned to a marker, 2 to 100000. Larger values
        use more evidence and decide later.
    ghost_radius : float
        Typical distance of a ghost from its marker, metres, > 0.
    max_occlusion : int
        Longest occlusion after which a marker can reappear under its old label, frames. It bounds
        the memory of endless streams; the default of 20000 frames is over a minute at 300 Hz.
    lag : int, optional
        Number of frames within which the method's revisions are used, 0 to 10000; later ones are
        ignored. By default one less than its `window`, or 2 for a method without a window.

    Raises
    ------
    ParameterError
        If an option is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, seed=1)
    >>> burst = am.simulate.Burst(n=2, shortest=10, longest=20)
    >>> d = am.simulate.corrupt(truth, burst=burst, seed=1).detections
    >>> method = am.tracking.Stitched()
    >>> state = method.init(am.estimate_model(d).model)
    >>> for time, points in d:
    ...     state, update = method.step(state, time, points)
    >>> state
    StitchedState(3-D, 426 detections taken, 1 joins, 0 cuts, 0 ghosts)
    """

    name: ClassVar[str] = "stitched"

    method: Method[Any] = field(default_factory=_over_three_frames)
    confirm: int = 15
    ghost_radius: float = 0.03
    max_occlusion: int = 20_000
    lag: int | None = None

    def __post_init__(self) -> None:
        check_kind("method", self.method, Method, "am.SMP(window=3)")
        check_options(self.confirm, self.ghost_radius, self.max_occlusion)
        if self.lag is not None:
            check_number("lag", self.lag, above=0, below=10_000, closed=True, integer=True)

    def init(
        self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None
    ) -> StitchedState:
        """Return the state before the first frame.

        Parameters
        ----------
        model, n_axes, seed
            As for `Method.init`.

        Returns
        -------
        StitchedState
        """
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
        model = tracklet_model(model)
        tracklets = self.method.init(model, n_axes=n_axes, seed=seed)
        options = stitch_options(model, self.confirm, self.ghost_radius, self.max_occlusion)
        lag = getattr(self.method, "window", 3) - 1 if self.lag is None else self.lag
        stitcher = _engine.LiveStitcher(motion_model(model, n_axes), options, lag=lag)
        return StitchedState(tracklets=tracklets, stitcher=stitcher, model=model, n_axes=n_axes)

    def step(
        self,
        state: StitchedState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[StitchedState, Update]:
        """Process the next frame.

        Parameters
        ----------
        state, time, points, covariances
            As for `Method.step`.

        Returns
        -------
        state, update
            Next state, and the labels of markers that the frame decides or revises.
        """
        check_kind("state", state, StitchedState, "method.init(model)")
        tracklets, method = state.tracklets, self._engine_method
        if method is not None and isinstance(tracklets, EngineState):
            stitcher = state.prepared.pop() if state.prepared else state.stitcher.copy()
            tracklets, update = method.step_stitched(
                tracklets, stitcher, state.stitcher, time, points, covariances
            )
        else:
            stitcher = state.stitcher.copy()
            frame = checked_frame(time, state.last_time, points, state.n_axes)
            tracklets, found = self.method.step(tracklets, time, frame, covariances=covariances)
            motion, dt = state.model.motion, time - state.last_time
            F, Q = no_transition(motion) if dt == float("inf") else transition(motion, dt)
            labels, revised, revised_labels = stitcher.step(
                F, Q, frame, found.labels, found.revised, found.revised_labels
            )
            update = Update(
                labels=labels, revised=revised, revised_labels=revised_labels, info=found.info,
                read_tracks=partial(_tracks_of, stitcher, found),
            )  # fmt: skip
        after = StitchedState(
            tracklets=tracklets, stitcher=stitcher, model=state.model, n_axes=state.n_axes,
            last_time=time, prepared=[],
        )  # fmt: skip
        return after, update

    @cached_property
    def _engine_method(self) -> EngineMethod | None:
        """The method, if it tracks and stitches in one call; None otherwise."""
        return self.method if isinstance(self.method, EngineMethod) else None

    def prepare(self, state: StitchedState) -> None:
        """Do most of the next step's stitching, and prepare its method; see `Method.prepare`.

        The frame that waits longest is stitched on a copy. If the method revises it in the next
        step, that copy is not used.
        """
        if self._engine_method is not None and not state.prepared:
            ahead = state.stitcher.copy()
            ahead.look_ahead()
            state.prepared.append(ahead)
        self.method.prepare(state.tracklets)


def _tracks_of(stitcher: _engine.LiveStitcher, found: Update) -> TrackStates | None:
    """Return the states of the markers: those of their tracklets, and of the occluded markers."""
    own = found.tracks
    if own is None:
        return None
    log_odds = np.full(len(own), np.nan) if own.log_odds is None else own.log_odds
    merged = states_of(*stitcher.states(own.ids, own.gaps, log_odds, own.means, own.covariances))
    return merged if own.log_odds is not None else replace(merged, log_odds=None)
