"""First scales of a capture, from unambiguous links.

Mutual nearest neighbours in consecutive frames, much nearer than the second nearest, are linked.
They are biased towards slow markers, which is accurate enough for a start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections

__all__ = ["Scales", "first_scales"]

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


def first_scales(pieces: list[Detections]) -> Scales:
    """Estimate the scales from runs of consecutive frames.

    Parameters
    ----------
    pieces : list of Detections
        Runs of consecutive frames of the capture.

    Returns
    -------
    Scales

    Raises
    ------
    ParameterError
        If no point has an unambiguous link to the next frame.
    """
    steps: list[NDArray[np.float64]] = []
    jolts: list[NDArray[np.float64]] = []
    spacings: list[NDArray[np.float64]] = []
    for piece in pieces:
        filled = np.flatnonzero(piece.counts)
        frames = [piece.frame(int(t)) for t in filled]
        linked: dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
        stride = max(1, piece.n_points * len(pieces) // LINKED_POINTS)
        for i in range(0, len(filled) - 2, stride):
            a, b, c = frames[i : i + 3]
            dt1, dt2 = np.diff(piece.times[filled[i : i + 3]])
            for pair in (i, i + 1):  # with a stride of 1 all but the last are known already
                if pair not in linked:
                    linked[pair] = _sure_links(frames[pair], frames[pair + 1])
            forward, spacing = linked[i]
            spacings.append(spacing)
            onward, _ = linked[i + 1]
            k = np.flatnonzero(forward >= 0)
            steps.append((b[forward[k]] - a[k]) / dt1)
            k = k[onward[forward[k]] >= 0]
            j = forward[k]
            jolts.append((c[onward[j]] - b[j]) / dt2 - (b[j] - a[k]) / dt1)
    step = float(np.median([p.step for p in pieces]))
    velocities = np.concatenate(steps) if steps else np.empty((0, 3))
    # Change of position against constant velocity, metres.
    bends = np.abs(np.concatenate(jolts)).ravel() * step if jolts else np.empty(0)
    if len(velocities) < 3 or not len(bends):
        raise ParameterError(
            "detections",
            "points that can be followed from frame to frame, to estimate a model from",
            "none that are nearer to their next position than to other points",
            "give a model",
        )
    extent = max(float(np.ptp(p.points, axis=0).max()) for p in pieces)
    floor = max(extent, 1e-3) * 1e-6
    speeds = np.linalg.norm(velocities, axis=1)
    quiet, busy = np.quantile(bends, [0.3, 0.99])
    # White noise of σ gives second differences of √6 σ. The median of |N(0, 1)| is 0.67, its 30 %
    # quantile 0.39.
    noise = max(float(quiet) / 0.39 / np.sqrt(6.0), floor)
    low = max(float(np.median(bends)) / 0.67, noise) / step**2
    known = np.concatenate(spacings)
    known = known[np.isfinite(known)]
    return Scales(
        step=step,
        noise=noise,
        noise_floor=floor,
        speed=max(float(np.sqrt((velocities**2).mean())), noise / step),
        top_speed=max(float(speeds.max()), noise / step),
        acceleration_low=low,
        acceleration_high=max(float(busy) / step**2, 3 * low),
        spacing=float(np.median(known)) if len(known) else max(extent, floor),
    )


def _sure_links(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Link points to the next frame if the link is unambiguous.

    Returns
    -------
    link : ndarray of int, shape (len(a),)
        Index into `b`, -1 for an ambiguous link.
    spacing : ndarray, shape (len(a),)
        Distance to the nearest other point of `a`, inf if there is none.
    """
    from scipy.spatial import KDTree

    link = np.full(len(a), -1, dtype=np.int64)
    if not len(a) or not len(b):
        return link, np.full(len(a), np.inf)
    # If there are fewer points than neighbours, SciPy returns inf for the distance.
    neighbours: Any = KDTree(b)
    distance, nearest = neighbours.query(a, k=2)
    own: Any = KDTree(a)
    spacing = own.query(a, k=2)[0][:, 1]
    back = own.query(b)[1]
    is_mutual = back[nearest[:, 0]] == np.arange(len(a))
    is_clear = (distance[:, 0] < 0.3 * distance[:, 1]) & (distance[:, 0] < 0.3 * spacing)
    sure = is_mutual & is_clear
    link[sure] = nearest[sure, 0]
    return link, spacing
