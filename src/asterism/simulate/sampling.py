"""Sampling of a scene: frames that a capture keeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.simulate.corrupted_points import Points

__all__ = ["jittered", "kept_frames"]


def kept_frames(
    rng: np.random.Generator, n_frames: int, stride: int, dropped: float
) -> NDArray[np.int64]:
    """Return the frames that are kept: every `stride`-th frame without the lost ones.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    n_frames : int
        Number of frames of the original.
    stride : int
        Step between frames.
    dropped : float
        Probability that a frame is lost.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    frames = np.arange(0, n_frames, stride)
    return frames[rng.random(len(frames)) >= dropped] if dropped else frames


def jittered(
    rng: np.random.Generator, jitter: float, times: NDArray[np.float64], points: Points
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shift the time of each frame at random, and interpolate the points.

    A position is interpolated by the parabola through the marker's positions in this frame and its
    neighbours, or linearly if one neighbour is missing.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    jitter : float
        Twice the largest shift, as a share of the frame interval.
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    points : Points
        Points of the frames.

    Returns
    -------
    times : ndarray of shape (T,)
        Shifted times, seconds.
    places : ndarray of shape (N, D)
        Positions of the points at these times, metres.
    """
    n_frames = len(times)
    if n_frames < 2:
        return times, points.places
    part = jitter * rng.uniform(-0.5, 0.5, n_frames)
    step = np.diff(times)
    ahead, back = np.append(step, step[-1]), np.insert(step, 0, step[0])
    moved = times + np.where(part > 0, part * ahead, part * back)

    n_markers = int(points.markers.max(initial=-1)) + 1
    where = np.full((n_frames + 2, n_markers + 1), -1)
    is_marker = points.markers >= 0
    where[points.frames[is_marker] + 1, points.markers[is_marker]] = np.flatnonzero(is_marker)
    before = where[points.frames, points.markers]
    after = where[points.frames + 2, points.markers]
    here = points.places
    tau = (moved - times)[points.frames][:, None]
    h0, h1 = back[points.frames][:, None], ahead[points.frames][:, None]
    slope0 = np.where((before >= 0)[:, None], (here - here[before]) / h0, np.nan)
    slope1 = np.where((after >= 0)[:, None], (here[after] - here) / h1, np.nan)
    both = np.isfinite(slope0[:, :1]) & np.isfinite(slope1[:, :1])
    bend = np.where(both, (slope1 - slope0) / (h0 + h1), 0.0)
    line = np.where(np.isfinite(slope0), slope0, np.where(np.isfinite(slope1), slope1, 0.0))
    # Newton's form of the parabola through this position, the previous and the next one.
    shift = np.where(both, slope0 * tau + bend * tau * (tau + h0), line * tau)
    return moved, here + shift
