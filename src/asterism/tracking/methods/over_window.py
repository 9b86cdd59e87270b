"""What the methods share that keep several ways on for each track, over a window of frames."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.records import record
from asterism.tracking.methods.with_bodies import WithBodies

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism import _engine

__all__ = ["Hypotheses", "branch_options", "check_window"]


def check_window(window: float, least: int) -> None:
    """Raise `ParameterError` where the engine cannot keep so many frames open."""
    check_number("window", window, above=least, below=16, closed=True, integer=True)


def branch_options(
    *,
    window: float,
    max_branches: float,
    prune_odds: float,
    merge_last: float | None = None,
    fading: float = 1.0,
    limits: NDArray[np.float64] | None = None,
    z: float = 0.0,
) -> _engine.BranchOptions:
    """Make the engine's options of branches; without `limits` there is no χ² test."""
    from asterism import _engine

    return _engine.BranchOptions(
        window=int(window),
        max_branches=int(max_branches),
        merge_last=int(window if merge_last is None else merge_last),
        prune_drop=math.log(prune_odds),
        fading=fading,
        delta=np.empty(0) if limits is None else limits,
        z=z,
    )


@record
class Hypotheses(WithBodies):
    """Options of every method that explains all detections of a window at once.

    Parameters
    ----------
    window : int
        Frames until one is decided, 2 to 16.
    prune_odds : float
        What is so many times less likely than the best is not followed further.
    new_track_odds : float
        A detection that a believed track expects by more than these odds begins no track.
    gate_probability, confirm_probability, delete_odds : float
        See `FrameByFrame`.
    bodies, max_carried, bond_weight
        See `WithBodies`.
    """

    window: int = 3
    prune_odds: float = 100.0
    new_track_odds: float = 1000.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_window(self.window, 2)
        check_number("prune_odds", self.prune_odds, above=1)
        check_number("new_track_odds", self.new_track_odds, above=0)

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        return super()._about(stats) | {
            "branches": stats.n_branches,
            "most_branches": stats.most_branches,
        }
