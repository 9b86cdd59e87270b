"""The stable marriage of tracks and detections (§5 of the report; Gale & Shapley 1962)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from asterism.checks import check_fields, check_number
from asterism.errors import ParameterError
from asterism.records import record
from asterism.tracking.methods.engine_method import EngineMethod
from asterism.tracking.methods.options import (
    Gate,
    Lifecycle,
    Rigidity,
    carry_options,
    check_flags,
    check_shared,
    engine_model,
    shared_counts,
)
from asterism.tracking.methods.over_window import branch_options, check_window

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from asterism import _engine
    from asterism.model import Detections, TrackingModel
    from asterism.tracking.methods.base import Update
    from asterism.tracking.methods.engine_method import EngineState

__all__ = ["SMP"]

MAX_WAYS = 30
PRUNE_ODDS = 1e6
"""With a window: so many ways on are followed of each track, none so many times less likely."""


@record
class SMP(EngineMethod):
    """Stable marriage: no track and detection would both rather have each other.

    Tracks (the report's men) rank the detections by their predictive density N(ŷ, S); detections
    rank the tracks by distance, nearest first. Confirmed tracks marry before tentative ones.
    Whoever is outside the gate is unacceptable, so numbers may differ: a track left alone is a
    missed detection, a detection left alone a new track or clutter. Ties go to the lower index.

    Parameters
    ----------
    proposers : {"tracks", "detections"}
        Who proposes, and so for whom the matching is best among the stable ones.
    strict : bool
        The report's own method: as many detections in every frame as in the first, all of markers;
        everyone ranks everyone, without a gate. It refuses a frame with another number.
    capacity : int
        So many detections may marry one track (hospitals and residents, §5.6): a marker seen as
        two blobs. They are merged by their likelihood; the likeliest bears the label.
    merged_within : float
        With a capacity above 1, greatest distance of a further detection from the one that the
        track likes best, metres.
    window : int
        Preferences from so many frames, 1 to 16 (past history, §5.6): a frame is decided when
        `window` frames have come. A track then ranks the frame's detections by the likelihood of
        the best way on from each through the window, a detection ranks tracks by their mean squared
        distance along it. Until then labels are what would be decided now, and may change.
    gate : Gate
        Which detections a track may take.
    lifecycle : Lifecycle
        When a tentative track is confirmed or deleted.
    rigid : Rigidity, optional
        How neighbours predict occluded markers; None where they do not.
    """

    proposers: Literal["tracks", "detections"] = "tracks"
    strict: bool = False
    capacity: int = 1
    merged_within: float = 0.02
    window: int = 1
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "smp"

    def __post_init__(self) -> None:
        check_shared(self)
        check_fields("proposers", [self.proposers], ("tracks", "detections"))
        check_flags(self, "strict")
        check_number("capacity", self.capacity, above=1, below=64, closed=True, integer=True)
        check_number("merged_within", self.merged_within, above=0)
        check_window(self.window, 1)
        if self.strict and self.capacity > 1:
            raise ParameterError("capacity", "1, as strict=True is given", self.capacity)
        if self.window > 1 and (self.strict or self.capacity > 1):
            given = "strict=True" if self.strict else f"capacity={self.capacity}"
            raise ParameterError("window", f"1, as {given} is given", self.window)
        if self.rigid is not None and self.strict:
            raise ParameterError("rigid", "None, as strict=True is given", repr(self.rigid))

    def _tracker(
        self, model: TrackingModel, n_axes: int, seed: int | None
    ) -> _engine.FrameTracker | _engine.TreeTracker:
        from asterism import _engine

        is_tracks = self.proposers == "tracks"
        pairing = (
            _engine.Pairing.tracks_propose if is_tracks else _engine.Pairing.detections_propose
        )
        if self.window == 1:
            return _engine.FrameTracker(
                *engine_model(self, model, n_axes),
                pairing=pairing,
                is_strict=self.strict,
                capacity=int(self.capacity),
                merged_within=self.merged_within,
                carry=carry_options(self.rigid),
            )
        ways = branch_options(window=self.window, max_branches=MAX_WAYS, prune_odds=PRUNE_ODDS)
        return _engine.TreeTracker(
            *engine_model(self, model, n_axes),
            ways,
            pairing=pairing,
            is_independent=False,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        return shared_counts(self, stats)

    def step(
        self,
        state: EngineState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[EngineState, Update]:
        """Take the next frame; see `Method.step`.

        Raises
        ------
        ParameterError
            If `strict` and the number of points is not that of the first frame.
        """
        if self.strict and state.tracker.n_frames:
            _check_number(len(np.asarray(points)), state.n_ids, f"in the frame at {time:g} s")
        return super().step(state, time, points, covariances=covariances)

    def run(
        self,
        state: EngineState,
        detections: Detections,
        *,
        progress: Callable[[int], Any] | None = None,
    ) -> tuple[EngineState, NDArray[np.int64], NDArray[np.float64] | None]:
        """Take all frames in the engine; the same labels as the loop over `step`."""
        if self.strict and detections.n_frames:
            wanted = state.n_ids if state.tracker.n_frames else int(detections.counts[0])
            for t in np.flatnonzero(detections.counts != wanted):
                _check_number(int(detections.counts[t]), wanted, f"in frame {t}")
        return super().run(state, detections, progress=progress)


def _check_number(n: int, wanted: int, where: str) -> None:
    if n != wanted:
        raise ParameterError(
            "points", f"{wanted} {where}, as many as in the first (strict=True)", n,
            "use strict=False, which knows misses, clutter, and markers that come and go",
        )  # fmt: skip
