"""Fills that meet their ends: what an estimate misses there is carried through the gap.

Symbols: W frames, n of them at the ends and L hidden; k the covariance over time of what is missed.
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
"""Times in which what is missed changes, that are tried; in lengths of the gap."""
NOISES = (1e-8, 1e-4, 1e-2)
"""Shares of its variance that are noise, that are tried."""
OFFSETS = (1.0, 1e3)
"""Variances of a constant beside it, that are tried."""
CAREFUL = SPANS.index(0.4) * len(NOISES) * len(OFFSETS) + NOISES.index(1e-4) * len(OFFSETS)
"""The way that is taken where nothing tells which is best: it promises little in the middle."""

LEAST_ENDS = 4
"""Frames at each end that are believed whatever they do."""
JUMP = 8.0
"""A marker has flickered that jumps so many times farther than is usual."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Bridges:
    """Several ways of carrying what is missed at the ends through a gap.

    Parameters
    ----------
    weights : ndarray, shape (M, B, L, n)
        Of the frames at the ends, for each hidden frame; B = 1 where all windows have equal times.
    left : ndarray, shape (L,)
        How the variance of what is missed rises from the ends to 1, by the careful way, in the last
        window.
    """

    weights: NDArray[np.float64]
    left: NDArray[np.float64]

    def carry(self, missed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Foretell what is missed, shape (M, B, L, D), from that at the ends (B, n, D)."""
        M, same, L, n = self.weights.shape
        if same > 1:
            return self.weights @ missed
        B, _, D = missed.shape
        # One product of two matrices is several times faster than one for each window.
        flat = self.weights.reshape(M * L, n) @ missed.swapaxes(0, 1).reshape(n, B * D)
        return flat.reshape(M, L, B, D).swapaxes(1, 2)


def bridges(times: NDArray[np.float64], is_end: NDArray[np.bool_]) -> Bridges:
    """Make the ways: Gaussian processes that are known at the ends.

    Their covariance is ``(1 + r + r²/3) exp(-r) + β`` with ``r = √5 Δ / τ`` (Matérn 5/2: twice
    differentiable, so that a fill has no kink), for several τ, β and shares of noise.

    Parameters
    ----------
    times : ndarray, shape (B, W)
        Seconds, of each window.
    is_end : ndarray of bool, shape (W,)
        Which frames are at the ends.

    References
    ----------
    Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, eq. 2.23 to 2.26, 4.17.
    """
    t = times - times[:, :1]
    if np.abs(t - t[-1]).max() < 1e-3 * t[-1, -1] / len(is_end):
        t = t[-1:]
    ends, hidden = t[:, is_end], t[:, ~is_end]
    length = (t[:, -1] - t[:, 0]) * (~is_end).mean()
    between = np.abs(ends[:, :, None] - ends[:, None, :])
    across = np.abs(hidden[:, :, None] - ends[:, None, :])
    # All ways at once: (span, noise, offset) before (B, L, n).
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
    """Tell which frames at the ends to believe: a marker may flicker before it is lost.

    Where a place is far from what the two before it foretell (those farther from the gap), all
    from there to the gap is left out.

    Parameters
    ----------
    places : ndarray, shape (n, D)
        Of the marker, within its body where there is one, metres.
    frames : ndarray of int, shape (n,)
        Those at both ends, in order of time.
    span : Span
        The gap.
    usual : float
        How far a place is from what the two before it foretell in the worst of ten frames, metres;
        of a hundred would be worse, but a marker that flickers often would set its own measure.

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
        found = found[found >= LEAST_ENDS]
        if len(found):
            kept[side[found[0] :]] = False
    return kept
