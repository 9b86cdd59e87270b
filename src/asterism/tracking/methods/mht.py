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
    """Hypothesis matrix of a cluster: the target of each detection in each hypothesis.

    Parameters
    ----------
    targets : ndarray of int, shape (k,)
        Numbers of the cluster's targets in order of birth. They are not track labels, which only
        confirmed targets have.
    detections : ndarray of int, shape (n,)
        Detections of the undecided frames on which its hypotheses differ, or that belong to its
        targets, numbered from 0 in order of arrival.
    origins : ndarray of int, shape (h, n)
        Target of each detection in each hypothesis, or -1 for clutter and for the only detection
        of a new marker.
    probabilities : ndarray of shape (h,)
        Probabilities of the hypotheses, in decreasing order, with sum 1.

    Examples
    --------
    Two markers for which there is one detection half-way between them in the last frame:

    >>> import asterism as am
    >>> times = np.arange(11) / 100
    >>> frames = [[[0, 0, 0], [0.02, 0, 0]]] * 10 + [[[0.01, 0, 0]]]
    >>> model = am.TrackingModel(
    ...     motion=am.DWNA(acceleration_sigma=20),
    ...     sensor=am.Sensor(noise_sigma=2e-3, p_detection=0.9, clutter_density=0.01),
    ...     population=am.Population(
    ...         birth_density=0.01, p_disappear=1e-3, max_speed=5, max_gap=10
    ...     ),
    ... )
    >>> method = am.MHT()
    >>> state = method.init(model)
    >>> for time, points in am.Detections.from_frames(times, frames):
    ...     state, update = method.step(state, time, points)
    >>> (cluster,) = method.hypotheses(state)
    >>> cluster.origins[:2, -1].tolist(), cluster.probabilities[:2].round(2)
    ([0, 1], array([0.5, 0.5]))
    """

    targets: NDArray[np.int64]
    detections: NDArray[np.int64]
    origins: NDArray[np.int64]
    probabilities: NDArray[np.float64]


@record
class MHT(EngineMethod):
    """Multiple hypothesis tracking of Reid: global hypotheses about all detections.

    Targets that compete for detections form a cluster with its own hypotheses. CLUSTER joins
    clusters that compete in a new frame. HYPGEN extends the hypotheses to the frame by Murty's k
    best assignments. REDUCE keeps the most probable distinct ones, decides frames older than the
    window by the most probable one (N-scan pruning), and separates targets that no longer compete.
    MASH removes the detections on which all hypotheses agree and confirms their targets. The score
    of a hypothesis is the log posterior of its partition (`log_posterior`).

    Until a frame is decided its labels are those of the most probable hypotheses, and can change.
    The confidence of a label is its probability over the hypotheses of its cluster.

    Parameters
    ----------
    window : int
        Number of frames after which a frame is decided, 2 to 16. Larger windows use more evidence
        and more time.
    max_hypotheses : int
        Largest number of hypotheses of a cluster, ≥ 1. Larger values need more time;
        ``info["limited"]`` counts the clusters with more, and ``info["max_dropped_odds"]`` is the
        largest odds of a dropped hypothesis against the most probable one of its cluster.
    prune_odds : float
        Odds against a cluster's most probable hypothesis beyond which a hypothesis is dropped.
        Larger values keep more hypotheses.
    merged_within : float
        Difference of estimates, in standard deviations, below which hypotheses with the same
        targets are merged into the most probable one; 0 merges none.
    new_track_odds : float
        Odds above which a detection of a confirmed track cannot start a new track, > 0. Larger
        values allow more hypotheses with new tracks, and need more time.
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
        """Return the hypotheses after the last frame, cluster by cluster.

        Clusters are independent: the probability of one hypothesis of each cluster is the product
        of their probabilities.

        Parameters
        ----------
        state : EngineState
            State from `init` or `step` of this method.

        Returns
        -------
        list of HypothesisCluster
            Clusters of the undecided frames; a cluster without ambiguity has one hypothesis.

        Raises
        ------
        ParameterError
            If the state belongs to another method.

        Examples
        --------
        >>> import asterism as am
        >>> d = am.simulate.cube(frames=20, seed=1).detections
        >>> method = am.MHT()
        >>> state, labels, confidence = method.run(method.init(am.estimate_model(d).model), d)
        >>> [len(cluster.probabilities) for cluster in method.hypotheses(state)]
        [1, 1, 1, 1, 1, 1, 1, 1]
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
            # The number of hypotheses is limited, not that of a target's branches.
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
            "peak_branches": counts.peak_branches,
            "most_hypotheses": counts.n_hypotheses,
            "merged": counts.n_merged,
            "limited": counts.n_limited,
            "max_dropped_odds": counts.bound,
        }
