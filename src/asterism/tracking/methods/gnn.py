"""Global nearest neighbour: the most likely assignment of detections to tracks in each frame.

Blackman & Popoli 1999, ch. 6; §2.4 of the report (linear assignment).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from asterism.records import record
from asterism.tracking.methods.engine_method import EngineMethod
from asterism.tracking.methods.options import (
    Gate,
    Lifecycle,
    Rigidity,
    carry_options,
    check_shared,
    engine_model,
    shared_counts,
)

if TYPE_CHECKING:
    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = ["GNN"]


@record
class GNN(EngineMethod):
    """Global nearest neighbour: one exact linear assignment in each frame.

    The gain of assigning a detection to a track is ``log P_d N(y; ŷ, S) / (λ_f + P_d λ_b) - log(1
    - P_d)``, relative to a missed detection and a point that is clutter or a new marker. For a
    tentative track it includes the odds that the track is a marker. The assignment with the largest
    total gain is computed exactly (shortest augmenting paths, group by group): first for confirmed
    tracks, then for tentative tracks among the remaining points.

    Parameters
    ----------
    gate : Gate
        Gate, the region in which a track can be assigned a detection.
    lifecycle : Lifecycle
        Confirmation and deletion of tentative tracks.
    rigid : Rigidity, optional
        Prediction of occluded markers by their neighbours; None for no such prediction.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> am.track(truth.detections, am.GNN()).n_tracks
    8
    """

    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "gnn"

    def __post_init__(self) -> None:
        check_shared(self)

    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> _engine.FrameTracker:
        from asterism import _engine

        return _engine.FrameTracker(
            *engine_model(self, model, n_axes),
            pairing=_engine.Pairing.assignment,
            is_strict=False,
            capacity=1,
            merged_within=0.0,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        return shared_counts(self, stats)
