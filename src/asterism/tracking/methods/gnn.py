"""Global nearest neighbour: the most likely joint pairing of tracks and detections, exactly.

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
    """Global nearest neighbour: each frame by one exact linear assignment.

    A pairing of track and detection wins ``log P_d N(y; ŷ, S) / (λ_f + P_d λ_b) - log(1 - P_d)``
    over a missed detection and a point left over as clutter or a new marker; for a tentative track
    the gain is weighed with the odds that it is a marker at all. The pairing with the greatest sum
    is found exactly (shortest augmenting paths, group by group): first for the confirmed tracks,
    then for the tentative ones among the points that are still free.

    Parameters
    ----------
    gate : Gate
        Which detections a track may take.
    lifecycle : Lifecycle
        When a tentative track is confirmed or deleted.
    rigid : Rigidity, optional
        How neighbours predict occluded markers; None where they do not.

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
