"""Starts of the search for names: the posture of a marker set laid over frames of a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet
    from asterism.model.upwards import Axis

__all__ = ["starts", "z_up"]

HEADINGS = 16
"""Number of directions that an upright subject may face."""
FRAMES = 3
"""Number of frames over which the posture is laid."""
UPRIGHT = 0.15, 0.1, 0.06
"""Standard deviation of a place in an upright body: two horizontal axes and up, metres."""
ANYHOW = 0.2
"""The same for a body in any position, per axis."""
MAX_COST = 30.0
"""Squared distance in standard deviations above which a track is no marker of the posture."""
KEPT = 8, 4
"""Numbers of upright starts and of others that are kept, the best ones."""


def starts(made: MarkerSet, positions: NDArray[np.float64], up: Axis) -> list[NDArray[np.int64]]:
    """Return possible names of tracks, the marker of each or -1, as starts of a search.

    Parameters
    ----------
    made : MarkerSet
        Markers with places.
    positions : ndarray of shape (T, n, 3)
        Positions of the tracks, metres, NaN without a detection.
    up : {"x", "y", "z"}
        Axis of the capture that points up.

    Notes
    -----
    Upright: the posture is scaled to the height of the points, placed over their centre, and turned
    to `HEADINGS` directions. Otherwise: its principal axes are laid over those of the points, four
    ways round. Each track takes the marker of one exact assignment of all.
    """
    place = z_up(made.places, made.up)
    known = np.flatnonzero(np.isfinite(place[:, 0]))
    if not len(known) or not positions.size:
        return []
    place = place[known]
    seen = np.isfinite(positions[..., 0]).sum(axis=1)
    fullest = np.flatnonzero(seen >= 0.95 * seen.max())
    chosen = fullest[np.unique(np.linspace(0, len(fullest) - 1, FRAMES).astype(np.int64))]
    upright: list[tuple[float, NDArray[np.int64]]] = []
    others: list[tuple[float, NDArray[np.int64]]] = []
    for frame in chosen:
        point = z_up(positions[frame], up)
        is_seen = np.flatnonzero(np.isfinite(point[:, 0]))
        for laid, sigma, found in (
            *((own, UPRIGHT, upright) for own in _upright(place, point[is_seen])),
            *((own, (ANYHOW,) * 3, others) for own in _by_axes(place, point[is_seen])),
        ):
            cost, match = _assigned(point[is_seen], laid, np.array(sigma))
            names = np.full(len(point), -1, dtype=np.int64)
            names[is_seen] = np.where(match >= 0, known[match], -1)
            found.append((cost, names))
    return [
        names
        for found, n in ((upright, KEPT[0]), (others, KEPT[1]))
        for _, names in sorted(found, key=lambda item: item[0])[:n]
    ]


def z_up(points: NDArray[np.float64], up: Axis) -> NDArray[np.float64]:
    """Return points with the axis that points up as the last, turned without reflection."""
    return np.roll(points, 2 - "xyz".index(up), axis=1)


def _upright(place: NDArray[np.float64], point: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Lay a posture over points by height and centre, in all headings."""
    low, high = place[:, 2].min(), place[:, 2].max()
    scale = float(np.ptp(point[:, 2])) / max(high - low, 1e-3)
    centred = place - [*place[:, :2].mean(axis=0), low]
    laid: list[NDArray[np.float64]] = []
    for angle in np.arange(HEADINGS) * 2 * np.pi / HEADINGS:
        c, s = np.cos(angle), np.sin(angle)
        turned = scale * centred @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        foot = np.array([*np.median(point[:, :2], axis=0), point[:, 2].min()])
        laid.append(turned + foot)
    return laid


def _by_axes(place: NDArray[np.float64], point: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Lay a posture over points by their principal axes, in the four ways without reflection."""
    if len(place) < 3 or len(point) < 3:
        return []
    axes: list[NDArray[np.float64]] = []
    spreads: list[float] = []
    for own in (place, point):
        _, size, rows = np.linalg.svd(own - own.mean(axis=0), full_matrices=False)
        rows = rows if np.linalg.det(rows) > 0 else rows * [[1], [1], [-1]]
        axes.append(rows)
        spreads.append(float(np.sqrt((size**2).sum() / len(own))))
    scale = spreads[1] / max(spreads[0], 1e-6)
    centred = scale * (place - place.mean(axis=0)) @ axes[0].T
    turns = ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])
    return [(centred * turn) @ axes[1] + point.mean(axis=0) for turn in turns]


def _assigned(
    point: NDArray[np.float64], laid: NDArray[np.float64], sigma: NDArray[np.float64]
) -> tuple[float, NDArray[np.int64]]:
    """Assign points to places by the smallest sum of squared distances; -1 for those left over."""
    from scipy.optimize import linear_sum_assignment

    distance2 = (((point[:, None] - laid[None]) / sigma) ** 2).sum(axis=2)
    distance2 = np.minimum(distance2, MAX_COST)
    alone = np.full((len(point), len(point)), MAX_COST - 1)
    cost = np.concatenate([distance2, alone], axis=1)
    rows, columns = linear_sum_assignment(cost)
    match = np.where(columns < len(laid), columns, -1)
    return float(cost[rows, columns].sum()), match
