"""Search for the same frames and the same detections in two captures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["same_detections", "same_frames"]


def same_frames(a: Detections, b: Detections) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the frames that two captures share, as indices ``(i_a, i_b)``, each of shape (M,).

    Times match if they differ by less than half the smallest spacing of either side, so that no
    time matches two others. Two single frames must agree to a microsecond.
    """
    spacings = np.concatenate([np.diff(a.times), np.diff(b.times)])
    if not a.n_frames or not b.n_frames:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    reach = spacings.min() / 2 if len(spacings) else 1e-6  # single frames have no spacing
    right = np.minimum(np.searchsorted(a.times, b.times), a.n_frames - 1)
    left = np.maximum(right - 1, 0)
    is_left = np.abs(a.times[left] - b.times) <= np.abs(a.times[right] - b.times)
    nearest = np.where(is_left, left, right)
    is_same = np.abs(a.times[nearest] - b.times) < reach
    return nearest[is_same], np.flatnonzero(is_same)


def same_detections(
    a: Detections, b: Detections, tolerance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the detections that two captures share.

    Parameters
    ----------
    a, b : Detections
        Captures to compare.
    tolerance : float
        Largest difference of a coordinate, metres, as in `align`.

    Returns
    -------
    i_a, i_b : ndarray of int, shape (M,)
        Indices of each shared detection, increasing in `i_a`.
    """
    if a is b or (
        np.array_equal(a.times, b.times)
        and np.array_equal(a.offsets, b.offsets)
        and np.array_equal(a.points, b.points)
    ):
        everything = np.arange(a.n_points)
        return everything, everything
    none = np.empty(0, dtype=np.int64)
    if a.n_axes != b.n_axes or not a.n_points or not b.n_points:
        return none, none
    frame_a, frame_b = same_frames(a, b)
    number = np.full(b.n_frames, -1)
    number[frame_b] = frame_a
    frames_b = number[b.frame_of]
    left_a, left_b = np.arange(a.n_points), np.flatnonzero(frames_b >= 0)
    points_a, points_b = ((1000 * d.points).astype(np.float32) / np.float64(1000) for d in (a, b))
    extent = max(np.abs(points_a).max(), np.abs(points_b).max())
    reach = tolerance + np.spacing(np.float32(1000 * extent)).item() / 1000

    found_a, found_b = [none], [none]
    while len(left_a) and len(left_b):
        pick_a, pick_b = _mutual_nearest(
            a.frame_of[left_a], points_a[left_a], frames_b[left_b], points_b[left_b], reach
        )
        if not len(pick_a):
            break
        found_a.append(left_a[pick_a])
        found_b.append(left_b[pick_b])
        left_a, left_b = np.delete(left_a, pick_a), np.delete(left_b, pick_b)
    i_a, i_b = np.concatenate(found_a), np.concatenate(found_b)
    order = np.argsort(i_a)
    return i_a[order], i_b[order]


def _mutual_nearest(
    frames_a: NDArray[np.int64],
    points_a: NDArray[np.float64],
    frames_b: NDArray[np.int64],
    points_b: NDArray[np.float64],
    reach: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs in the same frame that are mutual nearest neighbours within `reach`."""
    # Frame and first coordinate form one sorted axis, on which candidates lie in a short interval.
    low = min(points_a[:, 0].min(), points_b[:, 0].min()) - 1
    width = max(points_a[:, 0].max(), points_b[:, 0].max()) + 1 - low
    line_a = frames_a * width + (points_a[:, 0] - low)
    line_b = frames_b * width + (points_b[:, 0] - low)
    order = np.argsort(line_b, kind="stable")
    slack = reach + np.spacing(max(line_a.max(), line_b.max()))
    start = np.searchsorted(line_b[order], line_a - slack)
    stop = np.searchsorted(line_b[order], line_a + slack, side="right")

    pairs_a: list[NDArray[np.int64]] = []
    pairs_b: list[NDArray[np.int64]] = []
    for k in range(int((stop - start).max())):
        i = np.flatnonzero(start + k < stop)
        j = order[start[i] + k]
        is_near = (np.abs(points_a[i] - points_b[j]) <= reach).all(axis=1)
        pairs_a.append(i[is_near])
        pairs_b.append(j[is_near])
    if not pairs_a:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    i, j = np.concatenate(pairs_a), np.concatenate(pairs_b)
    distance = np.linalg.norm(points_a[i] - points_b[j], axis=1)
    # Of equally near neighbours the first is used, on both sides.
    nearest_b, nearest_a = np.full(len(points_a), -1), np.full(len(points_b), -1)
    far_first = np.lexsort((-j, -distance))
    nearest_b[i[far_first]] = j[far_first]
    far_first = np.lexsort((-i, -distance))
    nearest_a[j[far_first]] = i[far_first]
    a = np.flatnonzero(nearest_b >= 0)
    a = a[nearest_a[nearest_b[a]] == a]
    return a, nearest_b[a]
