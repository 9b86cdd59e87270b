"""Stable marriage of tracks and detections (§5 of the report; Gale & Shapley 1962)."""

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
    from asterism.tracking.methods.engine_method import EngineState

__all__ = ["SMP"]

MAX_WAYS = 30
PRUNE_ODDS = 1e6
"""With a window: largest number of branches of a track, and odds beyond which one is pruned."""


@record
class SMP(EngineMethod):
    """Stable marriage: a matching without a pair that prefer each other to their partners.

    Tracks (the men of the 2010 report) rank detections by their predictive density N(ŷ, S);
    detections rank tracks by distance. Confirmed tracks are matched before tentative ones. Pairs
    outside the gate are excluded, so numbers may differ: an unmatched track has a missed
    detection, an unmatched detection is a new track or clutter. Ties go to the lower index.

    Parameters
    ----------
    proposers : {"tracks", "detections"}
        Side that proposes; the result is the best stable matching for that side.
    strict : bool
        Whether to use the method of the 2010 report: all frames have the same number of
        detections, all of markers, and there is no gate. A frame with another number is an error.
    capacity : int
        Largest number of detections of a track in a frame, 1 to 64 (hospitals and residents, §5.6),
        for markers that are detected as two points. They are merged by their likelihood; the most
        likely one gets the label.
    merged_within : float
        Largest distance of a further detection from the track's preferred one, metres, > 0, used
        with a capacity above 1. The default of 20 mm is the diameter of a large marker.
    window : int
        Number of frames from which preferences are computed, 1 to 16 (past history, §5.6). A frame
        is decided after `window` frames. A track ranks its detections by the likelihood of the best
        continuation through the window, a detection ranks tracks by their mean squared distance
        along it. Until then labels are those of the current decision, and can change.
    gate : Gate
        Gate, the region in which a track can be assigned a detection.
    lifecycle : Lifecycle
        Confirmation and deletion of tentative tracks.
    rigid : Rigidity, optional
        Prediction of occluded markers by their neighbours; None for no such prediction.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> tracks = am.track(truth.detections, am.SMP(window=3))
    >>> tracks.n_tracks
    8

    The method of the 2010 report, one frame and then all others:

    >>> method = am.SMP(strict=True)
    >>> state = method.init(tracks.recipe.model)
    >>> state, update = method.step(state, truth.detections.times[0], truth.detections.frame(0))
    >>> state, labels, _ = method.run(state, truth.detections.part(1, 40))
    >>> update.labels.tolist(), labels[-8:].tolist()
    ([0, 1, 2, 3, 4, 5, 6, 7], [0, 1, 2, 3, 4, 5, 6, 7])
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

    def _check(self, state: EngineState, time: float, points: ArrayLike) -> None:
        if self.strict and state.tracker.n_frames:
            _check_number(len(np.asarray(points)), state.n_ids, f"in the frame at {time:g} s")

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
            Last state, label of every detection (N,), and None, as there is no confidence.
        """
        if self.strict and detections.n_frames:
            wanted = state.n_ids if state.tracker.n_frames else int(detections.counts[0])
            for t in np.flatnonzero(detections.counts != wanted):
                _check_number(int(detections.counts[t]), wanted, f"in frame {t}")
        return super().run(state, detections, progress=progress)


def _check_number(n: int, wanted: int, where: str) -> None:
    if n != wanted:
        raise ParameterError(
            "points", f"{wanted} {where}, as many as in the first (strict=True)", n,
            "use strict=False, which allows missed detections, clutter and new markers",
        )  # fmt: skip
