"""The track-splitting filter (§2.2 of the report; Smith & Buechler 1975)."""

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

MOST_FADING = 0.99
_EXACT_LIMITS = 4096


@record
class TrackSplitting(EngineMethod):
    """Track splitting: a branch for every detection in the gate and one for a miss.

    Each track is a tree. Along a branch ``λ(k) = ρ λ(k-1) + νᵀ S⁻¹ ν`` sums how far the detections
    lay from where they were expected; the branch is cut when ``λ(k) > δ(k)``, which for the right
    branch has the probability α. With ``ρ = 1``, as in the report, ``δ(k)`` is the χ² quantile of
    ``k D`` degrees of freedom. Over a whole life the test loses every track at last where the noise
    is but slightly greater than the model's, so by default the past fades: ``δ(k)`` is then the
    quantile of a weighted sum of χ² variables. The report's α is 0.01:
    of right branches one in a hundred is beyond the limit in any frame.

    Branches also end when they are far less likely than the tree's best, when their last detections
    are those of a likelier one, and beyond a number. A frame is decided when `window` frames have
    come: trees that want the same detection are resolved by assignment over their best branches.
    Until then labels are what would be decided now, and may change. What other trees expect of a
    frame that is not decided yet counts against taking it (linear multitarget; Musicki & La Scala
    2008).

    The confidence of a label is its probability when the frame is decided: the marginal over all
    ways of sharing it out, each pairing weighed with the tree's branches through it
    (`joint_marginals`). ``info["bound"]`` says how far off it may be where a group was too large to
    be summed exactly.

    Parameters
    ----------
    alpha : float
        α, the share of right branches that the χ² test cuts in a frame.
    fading : float
        ρ, what is left of λ after a frame: 1 as in the report, or above 0 to 0.99.
    window : int
        Frames until one is decided, 1 to 16.
    max_branches : int
        Most branches of a tree.
    merge_last : int
        Of branches that share their last so many frames the likeliest is kept. Fewer than `window`
        saves time; but what is decided next may have lost its alternatives then, and the confidence
        is too high.
    prune_odds : float
        A branch ends when it is so many times less likely than its tree's best.
    independent : bool
        Whether each tree goes on with what it likes best though another has it, as in the report:
        then only the labels are resolved, trees know nothing of each other, and two may follow one
        marker. Not with `rigid`.
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
        if not (self.fading <= MOST_FADING or self.fading == 1):
            raise ParameterError("fading", f"1, or at most {MOST_FADING}", repr(self.fading))
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
            "most_branches": counts.most_branches,
            "cut_branches": counts.n_cut,
            "dropped_branches": counts.n_limited,
            "shared_detections": counts.n_shared,
            "approximate_groups": counts.n_beams,
            "bound": counts.bound,
        }


@lru_cache(maxsize=16)
def chi2_limits(alpha: float, n_axes: int, fading: float) -> NDArray[np.float64]:
    """Give δ(k) of the test of a branch with k detections.

    Without fading ``P[χ²_{k D} > δ(k)] = α``. With fading λ(k) is a weighted sum of χ² variables,
    whose tail is taken from its saddlepoint (Lugannani & Rice 1980; Kuonen 1999).

    Parameters
    ----------
    alpha : float
        α.
    n_axes : int
        D, 2 or 3.
    fading : float
        ρ.

    Returns
    -------
    ndarray, shape (K,)
        For k = 1 to K; with fading the last one is that of all further k.
    """
    from scipy.special import chdtri

    if fading == 1:
        limits = np.asarray(chdtri(n_axes * np.arange(1, _EXACT_LIMITS + 1), alpha))
    else:
        n = math.ceil(math.log(1e-6) / math.log(fading)) + 1
        weights = np.asarray(fading ** np.arange(n), dtype=np.float64)
        further = [_upper_quantile(alpha, weights[:k], n_axes) for k in range(2, n + 1)]
        limits = np.array([float(chdtri(n_axes, alpha)), *further])
    limits.flags.writeable = False  # shared by all who ask
    return limits


def _upper_quantile(alpha: float, weights: NDArray[np.float64], n_axes: int) -> float:
    """Value that ``Σ w_i χ²_D`` exceeds with probability α; the weights fall from 1."""
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

    # Around s = 0, which is the mean, the formula is 0/0; there, as far as the tail is concerned,
    # a little to the side is as good.
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
