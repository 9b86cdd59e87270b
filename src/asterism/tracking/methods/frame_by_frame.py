"""What the methods that decide frame by frame share: gating, groups, and the life of a track.

A track begins tentative at a detection that no track took. Its score, the log odds of marker
against clutter, decides: above `confirm_probability` it is believed and gets the next identity,
together with all its detections so far; far below its best it is clutter again. Tentative tracks
choose among the points that the believed ones leave over. A believed track coasts through misses
and ends when the gap exceeds the model's d̄. The loop is in the engine.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING

from asterism.checks import check_number
from asterism.records import record
from asterism.tracking.methods import engine_method
from asterism.tracking.methods.engine_method import EngineMethod

if TYPE_CHECKING:
    from asterism import _engine
    from asterism.model import TrackingModel
    from asterism.tracking.methods.engine_method import Tracker

__all__ = ["FrameByFrame"]


@record
class FrameByFrame(EngineMethod):
    """Options of every frame-by-frame method.

    Parameters
    ----------
    gate_probability : float
        Share of true detections that the gate may lose, were the model exact: the χ² level.
    confirm_probability : float
        A tentative track is believed from this probability on.
    delete_odds : float
        A tentative track ends when its odds fall by this factor from their best.
    """

    gate_probability: float = 1e-9
    confirm_probability: float = 0.999
    delete_odds: float = 300.0

    def __post_init__(self) -> None:
        check_number("gate_probability", self.gate_probability, above=0, below=1)
        check_number("confirm_probability", self.confirm_probability, above=0.5, below=1)
        check_number("delete_odds", self.delete_odds, above=1)

    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> Tracker:
        from scipy.special import chdtri

        from asterism import _engine
        from asterism.model.compiled import motion_model, score_model

        p = self.confirm_probability
        life = _engine.LifeOptions(
            gate=float(chdtri(n_axes, self.gate_probability)),
            confirm_score=math.log(p / (1 - p)),
            delete_drop=math.log(self.delete_odds),
            max_candidates=engine_method.MAX_CANDIDATES,
        )
        return self._make(motion_model(model, n_axes), score_model(model), life)

    @abstractmethod
    def _make(
        self, motion: _engine.MotionModel, score: _engine.ScoreModel, life: _engine.LifeOptions
    ) -> Tracker:
        """Make the engine's tracker; nothing is drawn, so that there is no seed."""

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        """Tell what a frame, or a run of them, took."""
        return {
            "tracks": stats.n_confirmed,
            "tentative": stats.n_tentative,
            "pending": stats.n_pending,
            "candidates": stats.n_candidates,
            "groups": stats.n_groups,
            "largest_group": stats.largest_group,
        }
