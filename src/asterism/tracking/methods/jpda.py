"""Joint probabilistic data association (§2.1 of the report; Bar-Shalom & Li 1995, ch. 6)."""

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
    check_flags,
    check_shared,
    engine_model,
    shared_counts,
)

if TYPE_CHECKING:
    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = ["JPDA"]


@record
class JPDA(EngineMethod):
    """Joint probabilistic data association: an average over all associations of a frame.

    Every joint event assigns the detections to the confirmed tracks in one way. The marginal
    ``β_ij`` of a pairing is summed over all events, exactly if a group needs at most `max_states`
    states (`joint_marginals`). Pairings a billion times less likely than a missed detection are
    excluded. A track is updated by all its detections with these weights, and the mixture is
    reduced to one Gaussian. The axes share one covariance, so the spread of the means is averaged
    over them.

    Each track has an existence probability ``r`` (JIPDA; Musicki & Evans 2004): it is missed with
    probability ``1 - r P_d``, and every frame updates ``r``. Tentative tracks are assigned the
    remaining detections of the most probable event; the confidence of such a label assumes that
    the labels of the other tentative tracks are right.

    Labels are those of the most probable joint event, and their confidence is the marginal of the
    pairing. Without a label it is the probability that the point belongs to no track.

    Parameters
    ----------
    max_states : int
        Largest number of states of the exact sum over a group's events, 1 to 2^30. Larger groups
        are divided at links whose marginal is at most 10⁻⁶; what is still larger is summed over a
        beam of that size. ``info["bound"]`` bounds the error. Larger values need more time and
        memory.
    guard : bool
        Whether to prevent coalescence of tracks. Of all events that differ only by a permutation
        of tracks, only the most probable one updates them (JPDA*; Blom & Bloem 2000). Marginals
        and labels of the frame are not affected.
    sure_until_gap : bool
        Whether a confirmed track keeps existence probability 1 until its gap exceeds d̄, because
        missed detections come in bursts. Otherwise, as in JIPDA, each missed detection lowers the
        existence probability, and the track is terminated below ``1 - confirm_probability``.
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
    >>> tracks = am.track(truth.detections, am.JPDA())
    >>> tracks.n_tracks, tracks.info["bound"]
    (8, 0.0)
    """

    max_states: int = 2**14
    guard: bool = True
    sure_until_gap: bool = True
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "jpda"

    def __post_init__(self) -> None:
        check_shared(self)
        check_number("max_states", self.max_states, above=1, below=2**30, closed=True, integer=True)
        check_flags(self, "guard", "sure_until_gap")

    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> _engine.JointTracker:
        from asterism import _engine

        return _engine.JointTracker(
            *engine_model(self, model, n_axes),
            max_states=int(self.max_states),
            is_guarded=self.guard,
            is_sure_until_gap=self.sure_until_gap,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        from asterism import _engine

        assert isinstance(stats, _engine.JointStats)
        return shared_counts(self, stats) | {
            "approximate_groups": stats.n_beams,
            "bound": stats.bound,
            "most_states": stats.n_states,
            "unguarded_groups": stats.n_unguarded,
        }
