"""Multiple hypothesis tracking by whole hypotheses (§2.3 of the report; Reid 1979)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from asterism.checks import check_number
from asterism.errors import ParameterError
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
    from numpy.typing import NDArray

    from asterism import _engine
    from asterism.model import TrackingModel
    from asterism.tracking.methods.engine_method import EngineState

__all__ = ["MHT", "HypothesisCluster"]


@record(eq=False)
class HypothesisCluster:
    """The hypothesis matrix of a cluster: who has which detection, in each of its hypotheses.

    Parameters
    ----------
    targets : ndarray, shape (k,)
        Numbers of the cluster's targets, in order of birth; not identities, which only confirmed
        targets have.
    detections : ndarray, shape (n,)
        Detections of the frames that are not decided yet which its hypotheses differ about, or
        which its targets have; numbered from 0 in order of arrival.
    origins : ndarray, shape (h, n)
        By hypothesis the target that a detection comes from, or -1: clutter, or the first of a
        marker that has no other detection so far.
    probabilities : ndarray, shape (h,)
        Of the hypotheses, the likeliest first; their sum is 1.
    """

    targets: NDArray[np.int64]
    detections: NDArray[np.int64]
    origins: NDArray[np.int64]
    probabilities: NDArray[np.float64]


@record
class MHT(EngineMethod):
    """Reid's multiple hypotheses: whole explanations of all detections, from frame to frame.

    Targets that compete for detections form a cluster, which keeps its own hypotheses. CLUSTER
    joins clusters that a new frame makes compete; HYPGEN makes the best hypotheses about the frame
    out of those so far, by Murty's k best assignments; REDUCE keeps few of them, the likely and
    different ones, decides what is older than the window by the likeliest (N-scan pruning), and
    parts what competes no longer; MASH takes out the detections of which all hypotheses say the
    same and confirms the targets that they come from. A hypothesis has the log posterior of its
    partition (`log_posterior`).

    Until a frame is decided its labels are those of the likeliest hypotheses, and may change. The
    confidence of a label is its probability over the hypotheses of its cluster.

    Parameters
    ----------
    window : int
        Frames until one is decided, 2 to 16.
    max_hypotheses : int
        Most hypotheses of a cluster. ``info["limited"]`` counts where there would have been more,
        and ``info["most_dropped_odds"]`` is the greatest odds, against the cluster's likeliest, of
        any that was left out.
    prune_odds : float
        A hypothesis is dropped when it is so many times less likely than its cluster's likeliest.
    merged_within : float
        Of hypotheses with the same targets, whose estimates differ by less than so many standard
        deviations, the likeliest stands for all; 0 merges none.
    new_track_odds : float
        A detection that a confirmed track expects by more than these odds begins no track.
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
    >>> am.track(truth.detections, am.MHT()).n_tracks
    8
    """

    window: int = 3
    prune_odds: float = 1e6
    new_track_odds: float = 1000.0
    max_hypotheses: int = 100
    merged_within: float = 0.0
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "mht"

    def __post_init__(self) -> None:
        check_hypotheses(self)
        check_number("max_hypotheses", self.max_hypotheses, above=1, closed=True, integer=True)
        check_number("merged_within", self.merged_within, above=0, closed=True)

    def hypotheses(self, state: EngineState) -> list[HypothesisCluster]:
        """Give what the method holds possible after the last frame, cluster by cluster.

        Clusters are independent: the probability of a choice of one hypothesis of each is the
        product of theirs.

        Parameters
        ----------
        state : EngineState
            From `init` or `step` of this method.

        Returns
        -------
        list of HypothesisCluster

        Raises
        ------
        ParameterError
            If the state is another method's.
        """
        from asterism import _engine

        if not isinstance(state.tracker, _engine.MatrixTracker):
            raise ParameterError("state", "a state of MHT", type(state.tracker).__name__)
        found: list[HypothesisCluster] = []
        for targets, detections, origins, log_weights in state.tracker.clusters():
            p = np.exp(log_weights - log_weights.max())
            found.append(
                HypothesisCluster(
                    targets=targets,
                    detections=detections,
                    origins=origins,
                    probabilities=p / p.sum(),
                )
            )
        return found

    def _tracker(
        self, model: TrackingModel, n_axes: int, seed: int | None
    ) -> _engine.MatrixTracker:
        from asterism import _engine

        return _engine.MatrixTracker(
            *engine_model(self, model, n_axes),
            # The hypotheses are limited, not the branches of a target.
            branch_options(window=self.window, max_branches=1, prune_odds=self.prune_odds),
            max_hypotheses=int(self.max_hypotheses),
            merged_within=self.merged_within,
            new_track_claim=self.new_track_odds,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        counts = tree_counts(stats)
        return shared_counts(self, stats) | {
            "branches": counts.n_branches,
            "most_branches": counts.most_branches,
            "most_hypotheses": counts.n_hypotheses,
            "merged": counts.n_merged,
            "limited": counts.n_limited,
            "most_dropped_odds": counts.bound,
        }
