"""Track-oriented multiple hypothesis tracking (Kurien 1990; Blackman 2004)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from asterism.checks import check_number
from asterism.records import record
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
    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = ["TOMHT"]


@record
class TOMHT(EngineMethod):
    """Track-oriented multiple hypotheses: the best compatible set of track hypotheses.

    Each track is a tree: a branch for every detection in its gate and one for a miss, over a window
    of frames; every detection may begin a new one. A hypothesis takes one branch of each tree, no
    detection twice, and is worth its log posterior (`log_posterior`). In each cluster of trees that
    share detections the best one is found by exact set packing, and the oldest frame is decided by
    it (N-scan pruning). Until then labels are what would be decided now, and may change.

    The confidence of a label is its probability. Options of a tree that the best hypothesis of its
    cluster takes at odds worse than `prune_odds` count by a bound on that hypothesis alone. The
    trees that the other options join are enumerated: `max_hypotheses` hypotheses of each such set,
    so that independent ambiguities multiply. The confidence is exact where no option is left out
    and no set has more hypotheses; elsewhere it is an approximation.

    Parameters
    ----------
    window : int
        Frames until one is decided, 2 to 16.
    max_branches : int
        Branches of a cluster, for each track of its best hypothesis; every tree keeps one besides.
        This bounds memory and time. Branches are kept in the order of what the best hypothesis of
        the whole cluster loses with them; ``info["dropped_branches"]`` counts the branches beyond
        the limit.
    prune_odds : float
        Odds by which a branch may be worse. A branch is dropped when the best hypothesis of its
        cluster that holds it is less probable than the best of all by more than these odds times
        the odds of ending the track and beginning another.
    max_hypotheses : int
        Most hypotheses of a set of trees that probable options join, for the confidence; of these
        only those count that are not e^25 times less likely than the best.
    max_nodes : int
        Most nodes of the search in a cluster; where it is cut short, a compatible set is made of
        what was found, and ``info`` says by how many nats it may be below the best.
    new_track_odds : float
        A detection that a confirmed track expects by more than these odds begins no track.
    gate : Gate
        Which detections a track may take.
    lifecycle : Lifecycle
        When a tentative track is confirmed or deleted.
    rigid : Rigidity, optional
        How neighbours predict occluded markers; None where they do not.

    Notes
    -----
    With a window that covers the capture the result is the most probable partition of all
    (`log_posterior`) if no option excludes it: `prune_odds`, `max_branches` and `max_nodes` large
    enough, the probability of the `gate` near 0, `new_track_odds` and the `delete_odds` of the
    `lifecycle` large, and its `confirm_probability` near 0.5. A track whose odds are below those of
    `confirm_probability` is left out even where the most probable partition holds it.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> tracks = am.track(truth.detections, am.TOMHT())
    >>> tracks.n_tracks, tracks.info["gap"]
    (8, 0.0)
    """

    window: int = 3
    prune_odds: float = 100.0
    new_track_odds: float = 1000.0
    max_branches: int = 100
    max_hypotheses: int = 20
    max_nodes: int = 2000
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "tomht"

    def __post_init__(self) -> None:
        check_hypotheses(self)
        for name in ("max_branches", "max_hypotheses", "max_nodes"):
            check_number(name, getattr(self, name), above=1, closed=True, integer=True)

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
            max_hypotheses=int(self.max_hypotheses),
            max_nodes=int(self.max_nodes),
            new_track_claim=self.new_track_odds,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        counts = tree_counts(stats)
        return shared_counts(self, stats) | {
            "branches": counts.n_branches,
            "most_branches": counts.most_branches,
            "dropped_branches": counts.n_limited,
            "most_hypotheses": counts.n_hypotheses,
            "nodes": counts.n_nodes,
            "clusters_cut_short": counts.n_beams,
            "gap": counts.gap,
        }
