"""Interpolation of an estimate's residuals from the ends of a gap, so that a fill is continuous.

Symbols: W frames, n of them at the ends and L missing; k the covariance over time of the
residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.filling.spans import Span

__all__ = ["CAREFUL", "Bridges", "bridges", "is_steady"]

SPANS = (0.15, 0.4, 1.0, 3.0, 10.0)
"""Correlation times of the residuals that are tried, in lengths of the gap."""
NOISES = (1e-8, 1e-4, 1e-2)
"""Shares of noise in the variance of the residuals that are tried."""
OFFSETS = (1.0, 1e3)
"""Variances of a constant offset that are tried, relative to that of the residuals."""
CAREFUL = SPANS.index(0.4) * len(NOISES) * len(OFFSETS) + NOISES.index(1e-4) * len(OFFSETS)
"""Index of the default combination, with a short correlation time and a large variance mid-gap."""

MIN_ENDS = 4
"""Number of frames at each end that are always used."""
JUMP = 8.0
"""Ratio of a jump to the usual jump from which a marker has flickered."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Bridges:
    """Several interpolators of residuals from the ends through a gap.

    Parameters
    ----------
    weights : ndarray of shape (M, B, L, n)
        Weights of the frames at the ends for each missing frame; B = 1 if all windows have equal
        times.
    left : ndarray of shape (L,)
        Variance of the residuals in the last window relative to their prior variance, by the
        default interpolator: it increases from the ends to 1.
    """

    weights: NDArray[np.float64]
    left: NDArray[np.float64]

    def carry(self, missed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the residuals at the ends to the missing frames.

        Parameters
        ----------
        missed : ndarray of shape (B, n, D)
            Residuals at the ends of each window, metres.

        Returns
        -------
        ndarray of shape (M, B, L, D)
        """
        M, same, L, n = self.weights.shape
        if same > 1:
            return self.weights @ missed
        B, _, D = missed.shape
        # One matrix product is several times faster than one for each window.
        flat = self.weights.reshape(M * L, n) @ missed.swapaxes(0, 1).reshape(n, B * D)
        return flat.reshape(M, L, B, D).swapaxes(1, 2)


def bridges(times: NDArray[np.float64], is_end: NDArray[np.bool_]) -> Bridges:
    """Make the interpolators: Gaussian processes that are known at the ends.

    The covariance is ``(1 + r + r²/3) exp(-r) + β`` with ``r = √5 Δ / τ`` (Matérn 5/2: twice
    differentiable, so that a fill has no kink), for several τ, β and shares of noise.

    Parameters
    ----------
    times : ndarray of shape (B, W)
        Times of each window, seconds.
    is_end : ndarray of bool, shape (W,)
        True for frames at the ends.

    Returns
    -------
    Bridges

    References
    ----------
    Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, eq. 2.23 to 2.26, 4.17.
    """
    t = times - times[:, :1]
    if np.abs(t - t[-1]).max() < 1e-3 * t[-1, -1] / len(is_end):
        t = t[-1:]
    ends, missing = t[:, is_end], t[:, ~is_end]
    length = (t[:, -1] - t[:, 0]) * (~is_end).mean()
    between = np.abs(ends[:, :, None] - ends[:, None, :])
    across = np.abs(missing[:, :, None] - ends[:, None, :])
    # All interpolators at once: axes (span, noise, offset) before (B, L, n).
    tau = np.array(SPANS)[:, None, None, None, None, None] * length[:, None, None]
    noise = np.array(NOISES)[:, None, None, None, None] * np.eye(ends.shape[1])
    offset = np.array(OFFSETS)[:, None, None, None]
    K = _matern(between / tau) + noise + offset
    k = np.broadcast_to(_matern(across / tau) + offset, (*K.shape[:-2], *across.shape[1:]))
    solved = np.linalg.solve(K, k.swapaxes(-1, -2)).swapaxes(-1, -2)
    weights = solved.astype(np.float64, copy=False).reshape(-1, *solved.shape[-3:])
    k = k.reshape(weights.shape)[CAREFUL, -1]
    left = (1 + OFFSETS[0] - (weights[CAREFUL, -1] * k).sum(axis=1)).clip(min=0)
    return Bridges(weights=weights, left=left / left.max())


def _matern(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    r: NDArray[np.float64] = np.sqrt(5) * ratio
    return np.exp(-r) * (1 + r + r**2 / 3)


def is_steady(
    places: NDArray[np.float64], frames: NDArray[np.int64], span: Span, usual: float
) -> NDArray[np.bool_]:
    """Find the reliable frames at the ends; a marker may flicker before it is lost.

    If a position is far from its extrapolation from the two positions farther from the gap, all
    frames from there to the gap are left out.

    Parameters
    ----------
    places : ndarray of shape (n, D)
        Positions of the marker, relative to its body if there is one, metres.
    frames : ndarray of int, shape (n,)
        Frames at both ends, in order of time.
    span : Span
        Gap between the ends.
    usual : float
        90th percentile of the distance between a position and its extrapolation from the two
        before, metres. A higher percentile would include the flicker itself.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    kept = np.ones(len(frames), dtype=bool)
    for side in (np.flatnonzero(frames < span.first), np.flatnonzero(frames > span.last)[::-1]):
        y, gaps = places[side], np.abs(np.diff(frames[side]))
        missed = np.linalg.norm(y[2:] - 2 * y[1:-1] + y[:-2], axis=1)
        jumps = (missed > JUMP * usual) & (gaps[1:] == 1) & (gaps[:-1] == 1)
        found = 2 + np.flatnonzero(jumps)
        found = found[found >= MIN_ENDS]
        if len(found):
            kept[side[found[0] :]] = False
    return kept
