"""Track-splitting filter (§2.2 of the report; Smith & Buechler 1975)."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

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
    check_flags,
    check_shared,
    engine_model,
    shared_counts,
)
from asterism.tracking.methods.over_window import branch_options, check_window, tree_counts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = ["TrackSplitting", "chi2_limits"]

MAX_FADING = 0.99
_EXACT_LIMITS = 4096


@record
class TrackSplitting(EngineMethod):
    """Track splitting: a branch for every detection in the gate and one for a missed detection.

    Each track is a hypothesis tree. Along a branch ``λ(k) = ρ λ(k-1) + νᵀ S⁻¹ ν`` accumulates the
    NIS of the detections. The branch is pruned if ``λ(k) > δ(k)``, which has the probability α for
    the right branch. With ``ρ = 1``, as in the 2010 report, ``δ(k)`` is the χ² quantile of ``k D``
    degrees of freedom. That test eventually loses every track if the noise is slightly larger than
    the model's, so by default the past fades: ``δ(k)`` is the quantile of a weighted sum of χ²
    variables. The report's α is 0.01: one right branch in a hundred exceeds the limit in a frame.

    Branches are also pruned if they are far less likely than the best branch of the tree, if they
    share their last detections with a more likely one, and beyond `max_branches`. A frame is
    decided after `window` frames: trees that compete for a detection are resolved by assignment
    over their best branches. Until then labels are those of the current decision, and can change.
    Detections expected by other trees have a lower likelihood (linear multitarget; Musicki &
    La Scala 2008).

    The confidence of a label is its probability when the frame is decided: the marginal over all
    joint events, with pairings weighted by the tree's branches through them (`joint_marginals`).
    ``info["bound"]`` bounds its error if a group was too large for an exact sum.

    Parameters
    ----------
    alpha : float
        α, probability that the χ² test prunes the right branch in a frame, in (0, 1). Smaller
        values keep more branches.
    fading : float
        ρ, factor on λ in each frame: 1 as in the 2010 report, or in (0, 0.99]. Smaller values
        forget the past faster.
    window : int
        Number of frames after which a frame is decided, 1 to 16. Larger windows use more evidence
        and more time.
    max_branches : int
        Largest number of branches of a tree, ≥ 1. Larger values need more time and memory.
    merge_last : int
        Number of last frames whose equality merges branches into the most likely one. Fewer than
        `window` saves time, but removes alternatives of the next decision, and the confidence is
        then too high.
    prune_odds : float
        Odds against the tree's best branch beyond which a branch is pruned. Larger values keep
        more branches.
    independent : bool
        Whether trees keep detections that are assigned to other trees, as in the 2010 report. Only
        the labels are then resolved, and two trees can follow one marker. Not possible with
        `rigid`.
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
    >>> am.track(truth.detections, am.TrackSplitting()).n_tracks
    8
    """

    alpha: float = 1e-9
    fading: float = 0.5
    window: int = 3
    max_branches: int = 30
    merge_last: int = 8
    prune_odds: float = 1e6
    independent: bool = False
    gate: Gate = Gate()
    lifecycle: Lifecycle = Lifecycle()
    rigid: Rigidity | None = None

    name: ClassVar[str] = "splitting"

    def __post_init__(self) -> None:
        check_shared(self)
        check_number("alpha", self.alpha, above=0, below=1)
        check_number("fading", self.fading, above=0)
        if not (self.fading <= MAX_FADING or self.fading == 1):
            raise ParameterError("fading", f"1, or at most {MAX_FADING}", repr(self.fading))
        check_window(self.window, 1)
        check_number("max_branches", self.max_branches, above=1, closed=True, integer=True)
        check_number("merge_last", self.merge_last, above=1, closed=True, integer=True)
        check_number("prune_odds", self.prune_odds, above=1)
        check_flags(self, "independent")
        if self.rigid is not None and self.independent:
            raise ParameterError("rigid", "None, as independent=True is given", repr(self.rigid))

    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> _engine.TreeTracker:
        from scipy.special import ndtri

        from asterism import _engine

        branches = branch_options(
            window=self.window,
            max_branches=self.max_branches,
            prune_odds=self.prune_odds,
            merge_last=self.merge_last,
            fading=self.fading,
            limits=chi2_limits(self.alpha, n_axes, self.fading),
            z=float(-ndtri(self.alpha)),
        )
        return _engine.TreeTracker(
            *engine_model(self, model, n_axes),
            branches,
            pairing=_engine.Pairing.assignment,
            is_independent=self.independent,
            carry=carry_options(self.rigid),
        )

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        counts = tree_counts(stats)
        return shared_counts(self, stats) | {
            "branches": counts.n_branches,
            "peak_branches": counts.peak_branches,
            "cut_branches": counts.n_cut,
            "dropped_branches": counts.n_limited,
            "shared_detections": counts.n_shared,
            "approximate_groups": counts.n_beams,
            "bound": counts.bound,
        }


@lru_cache(maxsize=16)
def chi2_limits(alpha: float, n_axes: int, fading: float) -> NDArray[np.float64]:
    """Return the limits δ(k) of the χ² test of a branch with k detections.

    Without fading ``P[χ²_{k D} > δ(k)] = α``. With fading λ(k) is a weighted sum of χ² variables,
    whose tail is taken from its saddlepoint (Lugannani & Rice 1980; Kuonen 1999).

    Parameters
    ----------
    alpha : float
        α, probability that the test prunes the right branch.
    n_axes : int
        Number of coordinates D, 2 or 3.
    fading : float
        ρ, factor on λ in each frame.

    Returns
    -------
    ndarray of shape (K,)
        Limits for k = 1 to K; with fading the last one holds for all larger k.

    Examples
    --------
    >>> from asterism.tracking.methods.track_splitting import chi2_limits
    >>> chi2_limits(0.01, 3, 1.0)[:3].round(2)
    array([11.34, 16.81, 21.67])
    """
    from scipy.special import chdtri

    if fading == 1:
        limits = np.asarray(chdtri(n_axes * np.arange(1, _EXACT_LIMITS + 1), alpha))
    else:
        n = math.ceil(math.log(1e-6) / math.log(fading)) + 1
        weights = np.asarray(fading ** np.arange(n), dtype=np.float64)
        further = [_upper_quantile(alpha, weights[:k], n_axes) for k in range(2, n + 1)]
        limits = np.array([float(chdtri(n_axes, alpha)), *further])
    limits.flags.writeable = False  # the cached array is shared by all callers
    return limits


def _upper_quantile(alpha: float, weights: NDArray[np.float64], n_axes: int) -> float:
    """Return the value that ``Σ w_i χ²_D`` exceeds with probability α; weights decrease from 1."""
    from scipy.optimize import brentq
    from scipy.special import log_ndtr

    # K(s) = -D/2 Σ log(1 - 2 s w), s < 1/2; the sum's value at which s is the saddlepoint is K'(s).
    def parts(s: float) -> tuple[float, float, float]:
        left = 1 - 2 * s * weights
        first = n_axes * float((weights / left).sum())
        second = 2 * n_axes * float(((weights / left) ** 2).sum())
        return -n_axes / 2 * float(np.log(left).sum()), first, second

    def log_tail(s: float) -> float:
        K, first, second = parts(s)
        w = math.copysign(math.sqrt(2 * (s * first - K)), s)
        return float(log_ndtr(-(w + math.log(s * math.sqrt(second) / w) / w)))

    # At s = 0, which is the mean, the formula is 0/0. A nearby s is accurate enough for the tail.
    low, high = -1e3, 0.5 * (1 - 1e-9)
    target = math.log(alpha)
    if log_tail(1e-4) < target:
        high = -1e-4
    else:
        low = 1e-4
    if log_tail(low) <= target or log_tail(high) >= target:
        return parts(low if log_tail(low) <= target else high)[1]

    def excess(s: float) -> float:
        return log_tail(s) - target

    root: Any = brentq(excess, low, high, xtol=1e-14)
    return parts(float(root))[1]
