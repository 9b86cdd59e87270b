"""Multidimensional assignment over a sliding window (§2.4 of the report; Poore 1994; Deb 1997)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from asterism.checks import check_fields, check_number
from asterism.records import record
from asterism.solve import assign_multidimensional
from asterism.tracking.methods.engine_method import EngineMethod
from asterism.tracking.methods.options import (
    Gate,
    Lifecycle,
    Rigidity,
    carry_options,
    engine_model,
    shared_counts,
)
from asterism.tracking.methods.over_window import branch_options, check_hypotheses, tree_counts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = ["MDA"]


@record
class MDA(EngineMethod):
    """Multidimensional assignment: the best association of all detections of a window at once.

    A tuple holds a track, or none for a new one, and a detection or none of each frame of the
    window. Its weight is its part of the log posterior (`log_posterior`). `assign_multidimensional`
    finds the best set of tuples that share no track or detection, and decides the oldest frame by
    it. Until then labels are those of the current best set, and can change.

    Parameters
    ----------
    window : int
        Number of frames of the window, 2 to 16. Larger windows use more evidence and more time.
    solver : {"exact", "relaxed"}
        Solver of the assignment: HiGHS ("exact"), or Lagrangian relaxation ("relaxed").
        ``info["gap"]`` bounds the loss of a window against the optimum, nats.
    max_branches : int
        Largest number of tuples of a group of competing tracks, per track of its best choice.
        Every track, and every detection that can start one, keeps one more. Tuples are ranked by
        the loss of the group's best choice that contains them.
    prune_odds : float
        Odds below which a tuple is pruned. A tuple is left out if the best choice that contains it
        is less probable than the best of all by more than these odds times the odds of terminating
        the track and starting another. Larger values keep more tuples.
    new_track_odds : float
        Odds above which a detection of a confirmed track cannot start a new track, > 0. Larger
        values allow more hypotheses with new tracks, and need more time.
    gate : Gate
        Gate, the region in which a track can be assigned a detection.
    lifecycle : Lifecycle
        Confirmation and deletion of tentative tracks.
    rigid : Rigidity, optional
        Prediction of occluded markers by their neighbours; None for no such prediction.

    Notes
    -----
    With a window that covers the capture the result is the most probable partition of all if no
    option excludes it; see `TOMHT`.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> tracks = am.track(truth.detections, am.MDA())
    >>> tracks.n_tracks, tracks.info["gap"]
    (8, 0.0)
    """

    window: int = 3
    prune_odds: float = 100.0
    new_track_odds: float = 1000.0
    solver: Literal["exact", "relaxed"] = "exact"
    max_branches: int = 200
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "mda"

    def __post_init__(self) -> None:
        check_hypotheses(self)
        check_fields("solver", [self.solver], ("exact", "relaxed"))
        check_number("max_branches", self.max_branches, above=1, closed=True, integer=True)

    def _tracker(
        self, model: TrackingModel, n_axes: int, seed: int | None
    ) -> _engine.HypothesisTracker:
        from asterism import _engine

        branches = branch_options(
            window=self.window, max_branches=self.max_branches, prune_odds=self.prune_odds
        )
        return _engine.HypothesisTracker(
            *engine_model(self, model, n_axes),
            branches,
            max_hypotheses=1,
            max_nodes=1000,  # tracks that share nothing need one node
            new_track_claim=self.new_track_odds,
            carry=carry_options(self.rigid),
            choose=self._choose,
        )

    def _choose(
        self,
        first_option: NDArray[np.int64],
        gains: NDArray[np.float64],
        first_use: NDArray[np.int64],
        uses: NDArray[np.int32],
        first_resource: NDArray[np.int32],
    ) -> tuple[NDArray[np.int32], float]:
        """Choose an option of each tree; every tree has an option without a detection."""
        n_trees = len(first_option) - 1
        tree = np.repeat(np.arange(n_trees), np.diff(first_option))
        n_uses = np.diff(first_use)
        # A tree without a chosen tuple has its best option without a detection.
        free = np.full(n_trees, -1)
        for o in np.flatnonzero(n_uses == 0):
            if free[tree[o]] < 0 or gains[o] > gains[free[tree[o]]]:
                free[tree[o]] = o
        tuples = np.full((len(gains), 1 + len(first_resource)), -1)
        tuples[:, 0] = tree
        frame = np.searchsorted(first_resource, uses, side="right") - 1
        tuples[np.repeat(np.arange(len(gains)), n_uses), 1 + frame] = uses
        takes = np.flatnonzero(n_uses > 0)
        found = assign_multidimensional(
            tuples[takes], gains[takes] - gains[free[tree[takes]]], method=self.solver
        )
        own = free.copy()
        own[tree[takes[found.chosen]]] = takes[found.chosen]
        return (own - first_option[:-1]).astype(np.int32), found.bound + float(gains[free].sum())

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        counts = tree_counts(stats)
        return shared_counts(self, stats) | {
            "branches": counts.n_branches,
            "peak_branches": counts.peak_branches,
            "dropped_branches": counts.n_limited,
            "windows_with_a_gap": counts.n_beams,
            "gap": counts.gap,
        }
