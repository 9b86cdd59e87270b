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
    """Joint probabilistic data association: each frame averaged over all that it may mean.

    Every way of sharing the detections out among the confirmed tracks has a probability, and so has
    every pairing: ``β_ij``, summed over all of them, exactly where a group takes no more than
    `max_states` (`joint_marginals`). A pairing a billion times less likely than a miss is none. A
    track is moved by all its detections, each with its probability, and brought back to one
    Gaussian; the axes share one covariance, so what the detections differ by is shared out evenly
    among them.

    Each track has a probability ``r`` to exist (JIPDA; Musicki & Evans 2004): it is missed with
    probability ``1 - r P_d``, and what it is seen or missed with changes it. Tentative tracks take
    what the confirmed ones leave over by the likeliest event; the confidence of each label
    supposes that those of the other tentative tracks are right.

    Labels are those of the most probable joint event; their confidence is the marginal of the
    pairing. Where there is no label, it is the probability that the point is of no track.

    Parameters
    ----------
    max_states : int
        Most states of the exact sum over a group's events, 1 to 2^30; beyond that it is taken over
        a beam of as many, and ``info`` says how far off it can be.
    guard : bool
        Whether to guard against coalescence: of all events that differ only by who is who, the
        likeliest alone moves the tracks (JPDA*; Blom & Bloem 2000). Marginals and labels are the
        same with it and without.
    sure_until_gap : bool
        Whether a confirmed track counts as existing until its gap exceeds d̄: occlusions come in
        bursts, of which a probability of detection knows nothing. Otherwise, as in JIPDA, each miss
        makes it less likely to exist and to take a detection, and it ends below
        ``1 - confirm_probability``.
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
