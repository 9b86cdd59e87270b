"""First scales of a capture, from unambiguous links.

Mutual nearest neighbours in consecutive frames, much nearer than the second nearest, are linked.
They are biased towards slow markers, which is accurate enough for a start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism._engine import NearestPoints
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["Scales", "extents", "first_scales", "quantile"]

LINKED_POINTS = 15_000
"""Number of points that are linked to the next frames, in frames spread over the capture."""


@record
class Scales:
    """First estimates of step, noise, speed, acceleration and spacing, in SI units.

    Parameters
    ----------
    step : float
        Time between frames, seconds.
    noise, noise_floor : float
        Standard deviation of a coordinate, and its lower bound, metres.
    speed, top_speed : float
        Root mean square of a velocity coordinate, and speed of the fastest link, m/s.
    acceleration_low, acceleration_high : float
        Acceleration of a coordinate in quiet and in busy motion, m/s².
    spacing : float
        Median distance of a point from its nearest neighbour in the frame, metres.
    """

    step: float
    noise: float
    noise_floor: float
    speed: float
    top_speed: float
    acceleration_low: float
    acceleration_high: float
    spacing: float


def extents(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the extent of points along each axis, shape (D,).

    Parameters
    ----------
    points : ndarray of shape (N, D)
        Points.
    """
    # Along a column NumPy is ten times faster than over rows of three.
    return np.array([np.ptp(points[:, d]) for d in range(points.shape[1])])


def quantile(values: NDArray[np.float64], share: float) -> float:
    """Return the value that `np.quantile` returns, without its checks, which take most of its time.

    Parameters
    ----------
    values : ndarray of shape (N,)
        At least one number.
    share : float
        Share of the values below the result, 0 to 1.

    Returns
    -------
    float

    Examples
    --------
    >>> quantile(np.array([4.0, 1.0, 2.0]), 0.75)
    3.0
    """
    at = share * (len(values) - 1)
    k = int(at)
    above = min(k + 1, len(values) - 1)
    parted = np.partition(values, (k, above))
    low, high, part = float(parted[k]), float(parted[above]), at - k
    # The two forms differ in the last bit. The second one keeps the result within the interval.
    return low + (high - low) * part if part < 0.5 else high - (high - low) * (1 - part)


def first_scales(detections: Detections) -> tuple[Scales, NDArray[np.float64]]:
    """Estimate the scales of a capture, and how much its points move in each frame.

    Parameters
    ----------
    detections : Detections
        Capture.

    Returns
    -------
    scales : Scales
    activity : ndarray of shape (T,)
        Mean square distance of the points of a frame to the nearest point of the next frame, each
        limited to the spacing of the points, m²; NaN for frames that were not measured.

    Raises
    ------
    ParameterError
        If no point has an unambiguous link to the next frame.
    """
    d = detections
    links = _follow(d, 1 + d.n_points // LINKED_POINTS)
    velocities, jolts = links.velocities, links.jolts
    step = d.step
    bends = np.abs(jolts).ravel() * step  # change of position against constant velocity, metres
    if len(velocities) < 3 or not len(bends):
        raise ParameterError(
            "detections",
            "points that can be followed from frame to frame, to estimate a model from",
            "none that are nearer to their next position than to other points",
            "give a model",
        )
    extent = float(extents(d.points).max())
    floor = max(extent, 1e-3) * 1e-6
    speeds = np.linalg.norm(velocities, axis=1)
    quiet, busy = quantile(bends, 0.3), quantile(bends, 0.99)
    # White noise of σ gives second differences of √6 σ. The median of |N(0, 1)| is 0.67, its 30 %
    # quantile 0.39.
    noise = max(quiet / 0.39 / np.sqrt(6.0), floor)
    low = max(float(np.median(bends)) / 0.67, noise) / step**2
    known = links.spacings[np.isfinite(links.spacings)]
    spacing = float(np.median(known)) if len(known) else max(extent, floor)
    scales = Scales(
        step=step,
        noise=noise,
        noise_floor=floor,
        speed=max(float(np.sqrt((velocities**2).mean())), noise / step),
        top_speed=max(float(speeds.max()), noise / step),
        acceleration_low=low,
        acceleration_high=max(busy / step**2, 3 * low),
        spacing=spacing,
    )
    squares = np.minimum(links.distances, spacing) ** 2
    with np.errstate(invalid="ignore"):
        activity = np.bincount(links.frames, squares, d.n_frames) / np.bincount(
            links.frames, minlength=d.n_frames
        )
    return scales, activity


class _Links(NamedTuple):
    """Links of points to the next frames.

    Parameters
    ----------
    velocities, jolts : ndarray, shapes (V, D) and (J, D)
        Velocity over an unambiguous link, and its change over the next one, m/s.
    spacings : ndarray of shape (M,)
        Distance of each followed point to the nearest other point of its frame, inf if there is
        none.
    frames : ndarray of int, shape (M,)
        Frame of each followed point.
    distances : ndarray of shape (M,)
        Distance of each followed point to the nearest point of the next frame, metres.
    """

    velocities: NDArray[np.float64]
    jolts: NDArray[np.float64]
    spacings: NDArray[np.float64]
    frames: NDArray[np.int64]
    distances: NDArray[np.float64]


def _follow(d: Detections, stride: int) -> _Links:
    """Follow the points of every `stride`-th frame over the next two frames with points."""
    filled = np.flatnonzero(d.counts)
    rank = np.arange(len(filled))
    is_first = (rank % stride == 0) & (rank < len(filled) - 2)
    is_used = rank % stride < 3
    used = filled[is_used]
    points = d.points
    if stride > 3:  # frames that are not used would be copied
        points = points[np.repeat(is_used, d.counts[filled])]
    times = d.times[used]
    offsets = np.concatenate([[0], np.cumsum(d.counts[used])])
    frame = np.repeat(np.arange(len(used)), d.counts[used])
    first = np.flatnonzero(is_first[is_used][frame])
    nearest = NearestPoints(points, offsets)
    spacing = nearest.two(points[first], frame[first])[1][:, 1]
    link, distance = _sure_links(nearest, points, frame, first)
    is_linked = link >= 0
    a, b = first[is_linked], link[is_linked]
    velocity = (points[b] - points[a]) / np.diff(times)[frame[a], None]
    onward, _ = _sure_links(nearest, points, frame, b)
    c, before, b = onward[onward >= 0], velocity[onward >= 0], b[onward >= 0]
    jolt = (points[c] - points[b]) / np.diff(times)[frame[b], None] - before
    return _Links(velocity, jolt, spacing, used[frame[first]].astype(np.int64), distance)


def _sure_links(
    nearest: NearestPoints,
    points: NDArray[np.float64],
    frame: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Link chosen points to the next frame if the link is unambiguous.

    Parameters
    ----------
    nearest : NearestPoints
        Search among the points.
    points : ndarray of shape (N, D)
        Points of all frames.
    frame : ndarray of int, shape (N,)
        Frame of each point.
    chosen : ndarray of int, shape (M,)
        Points to link; none of the last frame.

    Returns
    -------
    link : ndarray of int, shape (M,)
        Point of the next frame, -1 for an ambiguous link.
    distance : ndarray of shape (M,)
        Distance to the nearest point of the next frame, metres.
    """
    t = frame[chosen]
    following, distance = nearest.two(points[chosen], t + 1)
    clear = np.flatnonzero(distance[:, 0] < 0.3 * distance[:, 1])
    # The other points of the same frame must be clearly farther too.
    spacing = nearest.two(points[chosen[clear]], t[clear])[1][:, 1]
    clear = clear[distance[clear, 0] < 0.3 * spacing]
    next_one = following[clear, 0]
    back = nearest.two(points[next_one], t[clear])[0][:, 0]
    link = np.full(len(chosen), -1)
    link[clear] = np.where(back == chosen[clear], next_one, -1)
    return link, distance[:, 0]
