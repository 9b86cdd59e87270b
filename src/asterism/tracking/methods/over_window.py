"""Common parts of the methods that keep several branches of each track over a window."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from asterism.checks import check_number
from asterism.tracking.methods.options import SharedOptions, check_shared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism import _engine

__all__ = ["branch_options", "check_hypotheses", "check_window", "tree_counts"]


def check_window(window: float, minimum: int) -> None:
    """Raise `ParameterError` if the engine cannot keep that many frames open.

    Parameters
    ----------
    window : int
        Number of frames, `minimum` to 16.
    minimum : int
        Smallest number of frames of the method.
    """
    check_number("window", window, above=minimum, below=16, closed=True, integer=True)


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
    """Return the engine's options of branches; without `limits` there is no χ² test.

    Parameters
    ----------
    window, max_branches, prune_odds, merge_last, fading
        As for `TrackSplitting`; `merge_last` is the window by default.
    limits : ndarray of shape (K,), optional
        Limits of the χ² test, from `chi2_limits`.
    z : float
        Standard normal quantile of the test, for branches with more than K detections.

    Returns
    -------
    BranchOptions
    """
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


class HypothesisOptions(SharedOptions, Protocol):
    """Options of every method that explains all detections of a window at once."""

    @property
    def window(self) -> int: ...
    @property
    def prune_odds(self) -> float: ...
    @property
    def new_track_odds(self) -> float: ...


def check_hypotheses(options: HypothesisOptions) -> None:
    """Raise `ParameterError` if an option of such a method is out of range.

    Parameters
    ----------
    options : HypothesisOptions
        Method to check.
    """
    check_shared(options)
    check_window(options.window, 2)
    check_number("prune_odds", options.prune_odds, above=1)
    check_number("new_track_odds", options.new_track_odds, above=0)


def tree_counts(stats: _engine.FrameStats) -> _engine.TreeStats:
    """Return the counts as those of a tracker of hypothesis trees.

    Parameters
    ----------
    stats : FrameStats
        Counts of the engine.

    Returns
    -------
    TreeStats
    """
    from asterism import _engine

    assert isinstance(stats, _engine.TreeStats)
    return stats
