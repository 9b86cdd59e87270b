"""Global nearest neighbour: the most likely joint pairing of tracks and detections, exactly.

Blackman & Popoli 1999, ch. 6; §2.4 of the report (linear assignment).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from asterism.records import record
from asterism.tracking.methods.with_bodies import WithBodies

if TYPE_CHECKING:
    from asterism import _engine

__all__ = ["GNN"]


@record
class GNN(WithBodies):
    """Global nearest neighbour: each frame by one exact linear assignment.

    A pairing of track and detection wins ``log P_d N(y; ŷ, S) / (λ_f + P_d λ_b) - log(1 - P_d)``
    over a missed detection and a point left over as clutter or a new marker; for a tentative track
    the gain is weighed with the odds that it is a marker at all. The pairing with the greatest sum
    is found exactly (shortest augmenting paths, group by group): first for the believed tracks,
    then for the tentative ones among the points that are still free.

    Parameters
    ----------
    gate_probability, confirm_probability, delete_odds : float
        See `FrameByFrame`.
    bodies, max_carried, bond_weight
        See `WithBodies`.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> am.track(truth.detections, am.GNN()).n_tracks
    8
    """

    name: ClassVar[str] = "gnn"

    def _make(
        self, motion: _engine.MotionModel, score: _engine.ScoreModel, life: _engine.LifeOptions
    ) -> _engine.FrameTracker:
        from asterism import _engine

        return _engine.FrameTracker(
            motion,
            score,
            life,
            matcher=0,
            is_strict=False,
            capacity=1,
            merged_within=0.0,
            carry=self._carry(),
        )
