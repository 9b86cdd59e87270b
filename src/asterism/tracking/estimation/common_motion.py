"""The rigid motion that most markers of a capture have in common, and the capture without it.

Markers on a hand or a face keep no stable distances, and may still move mostly together. Without
the motion in common, a marker moves little between two frames, and the motion model predicts it
better.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.checks import check_kind
from asterism.model import Detections

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.spatial import KDTree

__all__ = ["without_common_motion"]

MIN_FOR_TURN, MIN_PAIRS = 6, 4
"""Smallest number of pairs of points for a rotation, and for a translation."""
ROUNDS = 8
"""Largest number of times that a frame is paired with the points before and fitted to them."""
OUTLYING = 4.0
"""Distance of a pair from which it does not count, in the median distance of all pairs, times
`NORMAL`."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute values."""
NEWEST = 1 / 3
"""Weight of the newest detection in the position of a point."""
MAX_UNSEEN = 5
"""Number of frames without a detection after which a point is dropped."""
MAX_SHIFTED = 60
"""Largest number of detections of a frame whose pairs are searched for everywhere."""
N_SHIFTED = 8
"""About the number of detections of a frame that are each tried on every known point."""
DOUBTFUL, LOST = 0.5, 0.2
"""Agreement of a fit, 0 to 1, below which another one is searched for, and below which there is no
fit: the share of the detections that are paired, less for each the squared distance of the pair
relative to that of a point to the nearest other."""


class _Fit(NamedTuple):
    """Rotation and position of a frame, its pairs with the known points, and their agreement."""

    turn: NDArray[np.float64]
    at: NDArray[np.float64]
    ours: NDArray[np.int64]
    theirs: NDArray[np.int64]
    agreement: float


def without_common_motion(detections: Detections) -> Detections:
    """Remove the rigid motion that most markers have in common from a capture.

    Each frame is fitted to the points of the frames before, by a rotation and a translation: every
    point is paired with the detection nearest to it, and that with it, and outlying pairs have no
    weight (Tukey). The fit begins with the velocity of the frame before. If few pairs agree then,
    as where the markers are fast in the first frames, it also begins with the translation that
    pairs most. Distances between the detections of a frame stay as they are.

    Parameters
    ----------
    detections : Detections
        Capture of T frames, in 2-D or 3-D.

    Returns
    -------
    Detections
        The same detections in coordinates in which the markers as a whole are at rest. The origin
        is the median of the first frame that has detections.

    Raises
    ------
    ParameterError
        If it is no capture.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=200, seed=1)
    >>> d = truth.detections
    >>> still = am.tracking.without_common_motion(d)
    >>> paths = [each.points[truth.labels == 0] for each in (d, still)]
    >>> [f"{float(path.std(axis=0).max()):.4f}" for path in paths]
    ['0.5488', '0.0000']
    """
    from scipy.linalg import fractional_matrix_power

    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    d, D = detections.measured(), detections.n_axes
    points = np.empty_like(d.points)
    if not len(points):
        return d
    turn, at = np.eye(D), np.median(d.points[: d.counts[d.counts > 0][0]], axis=0)
    last_turn, velocity, last_dt = np.eye(D), np.zeros(D), 1.0
    known = np.empty((0, D))
    unseen, is_begun = np.empty(0, dtype=np.int64), False
    for t in range(d.n_frames):
        own = slice(d.offsets[t], d.offsets[t + 1])
        y, before = d.points[own], (turn, at)
        dt = d.times[t] - d.times[t - 1]
        if len(known):
            ratio = round(float(dt / last_dt), 6)  # times are rounded
            turn = np.real(fractional_matrix_power(last_turn, ratio)) @ turn
            at = at + dt * velocity
        turn, at, ours, theirs, agreement = _fitted(y, known, turn, at)
        is_new = np.ones(len(y), dtype=bool)
        is_new[ours] = False
        if agreement >= LOST:
            last_turn, last_dt = turn @ before[0].T, dt
            velocity = (at - before[1]) / dt
        elif len(y) < MIN_PAIRS:  # too few for a fit: the motion goes on while points are known
            is_new[:] = False
        else:  # lost: the points of this frame are the known ones
            turn = before[0]
            at = np.median(y, axis=0) if is_begun else at
            last_turn, velocity, is_begun = np.eye(D), velocity / 2, True
            known, unseen = known[:0], unseen[:0]
        z = points[own] = (y - at) @ turn
        unseen = unseen + 1
        known[theirs] += NEWEST * (z[ours] - known[theirs])
        unseen[theirs] = 0
        kept = unseen <= MAX_UNSEEN
        known = np.concatenate([known[kept], z[is_new]])
        unseen = np.concatenate([unseen[kept], np.zeros(int(is_new.sum()), dtype=np.int64)])
    return dataclasses.replace(d, points=points)


def _fitted(
    y: NDArray[np.float64],
    known: NDArray[np.float64],
    turn: NDArray[np.float64],
    at: NDArray[np.float64],
) -> _Fit:
    """Fit a frame to the known points, from here, or from the translation that pairs most."""
    from scipy.spatial import KDTree

    none = np.empty(0, dtype=np.int64)
    if min(len(y), len(known)) < MIN_PAIRS:
        return _Fit(turn, at, none, none, 0.0)
    tree = KDTree(known)
    apart = max(float(np.median(np.asarray(tree.query(known, k=2)[0])[:, 1])), 1e-9)
    fit = _paired(y, known, tree, apart, turn, at)
    if fit.agreement < DOUBTFUL and len(y) <= MAX_SHIFTED:
        begun = at - turn @ _shift((y - at) @ turn, known, tree, apart)
        other = _paired(y, known, tree, apart, turn, begun)
        fit = max(fit, other, key=lambda each: each.agreement)
    return fit if fit.agreement >= LOST else _Fit(turn, at, none, none, fit.agreement)


def _paired(
    y: NDArray[np.float64],
    known: NDArray[np.float64],
    tree: KDTree,
    apart: float,
    turn: NDArray[np.float64],
    at: NDArray[np.float64],
) -> _Fit:
    """Pair a frame with the known points, and fit it to them, until both agree."""
    from scipy.spatial import KDTree

    ours = theirs = np.empty(0, dtype=np.int64)
    agreement = 0.0
    for _ in range(ROUNDS):
        z = (y - at) @ turn
        distance, nearest = (np.asarray(each) for each in tree.query(z))
        back = np.asarray(KDTree(z).query(known)[1])
        ours = np.flatnonzero(back[nearest] == np.arange(len(z)))
        theirs, distance = nearest[ours], distance[ours]
        agreement = float(np.maximum(1 - (distance / apart) ** 2, 0).sum()) / len(y)
        scale = OUTLYING * NORMAL * float(np.median(distance))
        if not scale > 0:
            break
        weight = np.maximum(1 - (distance / scale) ** 2, 0) ** 2
        ours, theirs, weight = ours[weight > 0], theirs[weight > 0], weight[weight > 0]
        if len(ours) < MIN_PAIRS:
            return _Fit(turn, at, ours, theirs, 0.0)
        R, shift = _rigid(z[ours], known[theirs], weight)
        turn = _orthogonal(turn @ R.T)
        at = at - turn @ shift
        if np.abs(shift).max() + np.abs(R - np.eye(len(R))).max() * scale < 1e-3 * scale:
            break
    return _Fit(turn, at, ours, theirs, agreement)


def _shift(
    z: NDArray[np.float64], known: NDArray[np.float64], tree: KDTree, apart: float
) -> NDArray[np.float64]:
    """Return the difference of a known point and a detection by which most others are paired."""
    some = z[:: max(len(z) // N_SHIFTED, 1)]
    shifts = (known[:, None] - some).reshape(-1, z.shape[1])
    distance = np.asarray(tree.query(shifts[:, None] + z, distance_upper_bound=apart)[0])
    near = np.maximum(1 - (distance / apart) ** 2, 0).sum(axis=1)
    return shifts[near.argmax()]


def _rigid(
    a: NDArray[np.float64], b: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rotation R and the translation t of the least squares of R a + t - b."""
    share = weight / weight.sum()
    mean_a, mean_b = share @ a, share @ b
    R = np.eye(a.shape[1])
    if len(a) >= MIN_FOR_TURN:
        U, _, Vt = np.linalg.svd(((a - mean_a) * share[:, None]).T @ (b - mean_b))
        R[-1, -1] = np.sign(np.linalg.det(U @ Vt))
        R = Vt.T @ R @ U.T
    return R, mean_b - R @ mean_a


def _orthogonal(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation nearest to a product of rotations, in which rounding accumulates."""
    U, _, Vt = np.linalg.svd(R)
    return U @ Vt
