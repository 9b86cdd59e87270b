"""Stitching frame by frame: markers of a stream, through gaps of any length."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar

from asterism import _engine
from asterism.checks import check_kind, check_number
from asterism.model import TrackingModel
from asterism.model.compiled import motion_model, no_transition, transition
from asterism.records import record
from asterism.tracking.methods import SMP, Method, Update
from asterism.tracking.methods.base import MethodState, checked_frame
from asterism.tracking.stitching.tracklets import tracklet_model
from asterism.tracking.stitching.whole import check_options, stitch_options

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Stitched", "StitchedState"]


@record(eq=False)
class StitchedState:
    """The state of `Stitched`.

    Parameters
    ----------
    fragments : MethodState
        Of the method that makes them.
    stitcher : LiveStitcher
        The markers, in the engine.
    model : TrackingModel
        That of the fragments.
    n_axes : int
        2 or 3.
    last_time : float
        Of the last frame, seconds; -inf before the first.
    """

    fragments: MethodState
    stitcher: _engine.LiveStitcher
    model: TrackingModel
    n_axes: int
    last_time: float = float("-inf")

    def __repr__(self) -> str:
        stitcher = self.stitcher
        return (
            f"StitchedState({self.n_axes}-D, {self.n_seen} detections taken, "
            f"{stitcher.n_joins} joins, {stitcher.n_cuts} cuts, {stitcher.n_ghosts} ghosts)"
        )

    @property
    def n_seen(self) -> int:
        """Number of detections taken so far."""
        return self.stitcher.n_seen

    @property
    def info(self) -> dict[str, float]:
        """What the method tells of the fragments, and what was made of them."""
        return {
            **self.fragments.info,
            "joins": self.stitcher.n_joins,
            "cuts": self.stitcher.n_cuts,
            "ghosts": self.stitcher.n_ghosts,
        }


def _over_three_frames() -> Method[Any]:
    return SMP(window=3)


@record
class Stitched(Method[StitchedState]):
    """A method whose tracks are stitched as they come, for streams.

    What `identify` does with a whole take, with what is known by now. What comes back has the
    marker that it may be as soon as the method believes it and `lag` frames have passed, and its
    final label when it has been seen for `confirm` frames; earlier detections are revised. What
    was never seen before is -1 until then.

    Parameters
    ----------
    method : Method
        What makes the fragments.
    confirm, ghost_radius
        As for `stitch`.
    max_hidden : int
        Frames after which a hidden marker is forgotten, which bounds the memory of endless runs.
    lag : int, optional
        Frames for which the method may change its mind; what it revises later is not taken up.
        By default one less than its `window`, 2 where it has none.

    Raises
    ------
    ParameterError
        If an option is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1)
    >>> hidden = am.simulate.corrupt(truth, burst=am.simulate.Burst(), seed=1).detections
    >>> method = am.tracking.Stitched()
    >>> state = method.init(am.estimate_model(hidden).model)
    >>> for time, points in hidden:
    ...     state, update = method.step(state, time, points)
    >>> bool((update.labels >= 0).all())
    True
    """

    name: ClassVar[str] = "stitched"

    method: Method[Any] = field(default_factory=_over_three_frames)
    confirm: int = 15
    ghost_radius: float = 0.03
    max_hidden: int = 20_000
    lag: int | None = None

    def __post_init__(self) -> None:
        check_kind("method", self.method, Method, "am.SMP(window=3)")
        check_options(self.confirm, self.ghost_radius, self.max_hidden)
        if self.lag is not None:
            check_number("lag", self.lag, above=0, below=10_000, closed=True, integer=True)

    def init(
        self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None
    ) -> StitchedState:
        """Make the state before the first frame; see `Method.init`."""
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
        model = tracklet_model(model)
        fragments = self.method.init(model, n_axes=n_axes, seed=seed)
        options = stitch_options(model, self.confirm, self.ghost_radius, self.max_hidden)
        lag = getattr(self.method, "window", 3) - 1 if self.lag is None else self.lag
        stitcher = _engine.LiveStitcher(motion_model(model, n_axes), options, lag=lag)
        return StitchedState(fragments=fragments, stitcher=stitcher, model=model, n_axes=n_axes)

    def step(
        self,
        state: StitchedState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[StitchedState, Update]:
        """Take the next frame; see `Method.step`."""
        check_kind("state", state, StitchedState, "method.init(model)")
        frame = checked_frame(time, state.last_time, points, state.n_axes)
        fragments, found = self.method.step(state.fragments, time, frame, covariances=covariances)
        motion, dt = state.model.motion, time - state.last_time
        F, Q = no_transition(motion) if dt == float("inf") else transition(motion, dt)
        stitcher, labels, revised, revised_labels = state.stitcher.step(
            F, Q, frame, found.labels, found.revised, found.revised_labels
        )
        after = StitchedState(
            fragments=fragments, stitcher=stitcher, model=state.model, n_axes=state.n_axes,
            last_time=time,
        )  # fmt: skip
        return after, Update(
            labels=labels, revised=revised, revised_labels=revised_labels, info=found.info
        )
