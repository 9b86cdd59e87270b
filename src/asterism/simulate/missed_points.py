"""Missed detections of a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.simulate.corrupted_points import Points, touching
from asterism.simulate.episodes import episodes, stays

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.camera import Rig, Surface
    from asterism.simulate.episodes import Burst, Visits

__all__ = ["come_and_go", "in_bursts", "merge", "seen_by_rig", "shadowed"]


def in_bursts(
    rng: np.random.Generator, share: float, length: float, n_frames: int, n_markers: int
) -> NDArray[np.bool_]:
    """Draw bursts of missed detections by the two-state channel of Gilbert (1960).

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    share : float
        Expected share of missed detections.
    length : float
        Mean length of a burst, frames.
    n_frames, n_markers : int
        Numbers of frames and markers.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    again = 1.0 / length
    dice = rng.random((n_frames, n_markers))
    is_missed = np.empty((n_frames, n_markers), dtype=bool)
    chance = np.full(n_markers, share)
    for t in range(n_frames):
        is_missed[t] = dice[t] < chance
        chance = np.where(is_missed[t], 1.0 - again, share * again / (1.0 - share))
    return is_missed


def shadowed(
    rng: np.random.Generator, burst: Burst, points: Points, n_frames: int, n_markers: int
) -> NDArray[np.bool_]:
    """Find the points that a burst occludes.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    burst : Burst
        Number and lengths of the occlusions.
    points : Points
        Points of all markers.
    n_frames, n_markers : int
        Numbers of frames and markers.

    Returns
    -------
    ndarray of bool, shape (N,)
    """
    is_dark = np.zeros((n_frames, n_markers), dtype=bool)
    for start, stop in episodes(rng, burst, n_frames):
        is_dark[start:stop, rng.integers(n_markers)] = True
    is_marker = points.markers >= 0
    result = np.zeros(len(is_marker), dtype=bool)
    result[is_marker] = is_dark[points.frames[is_marker], points.markers[is_marker]]
    return result


def seen_by_rig(
    points: Points, rig: Rig, surfaces: Sequence[Surface], n_frames: int
) -> NDArray[np.int64]:
    """Return the cameras that see each marker past the surfaces.

    Parameters
    ----------
    points : Points
        Points of all markers, 3-D.
    rig : Rig
        Cameras, at most 62.
    surfaces : sequence of Surface
        Surfaces that occlude markers.
    n_frames : int
        Number of frames.

    Returns
    -------
    ndarray of int, shape (N,)
        Bit i is set if camera i sees the point.
    """
    is_marker = points.markers >= 0
    n_markers = int(points.markers.max(initial=-1)) + 1
    result = np.zeros(len(is_marker), dtype=np.int64)
    if not n_markers:
        return result
    dense = np.full((n_frames, n_markers, 3), np.nan)
    at = points.frames[is_marker], points.markers[is_marker]
    dense[at] = points.places[is_marker]
    for i, camera in enumerate(rig):  # one camera at a time limits the memory
        result[is_marker] |= camera.project(dense, surfaces).visible[at].astype(np.int64) << i
    return result


def come_and_go(
    rng: np.random.Generator, visits: Visits, points: Points, n_frames: int, n_markers: int
) -> tuple[Points, NDArray[np.int64]]:
    """Split markers into visits, and remove the points between visits.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    visits : Visits
        Lengths of the visits.
    points : Points
        Points of all markers.
    n_frames, n_markers : int
        Numbers of frames and markers.

    Returns
    -------
    points : Points
        Points during visits; every visit is a marker.
    origin : ndarray of int, shape (n_visits,)
        Original marker of each visit.
    """
    number = np.full((n_frames, n_markers), -1)
    origin: list[int] = []
    for k in range(n_markers):
        for start, stop in stays(rng, visits, n_frames):
            number[start:stop, k] = len(origin)
            origin.append(k)
    is_marker = points.markers >= 0
    markers = np.full(len(is_marker), -1)
    markers[is_marker] = number[points.frames[is_marker], points.markers[is_marker]]
    there = ~is_marker | (markers >= 0)
    return points._replace(markers=markers).where(there), np.array(origin, dtype=np.int64)


def merge(points: Points, distance: float) -> Points:
    """Merge points of a frame that are nearer to each other than a distance.

    Points are grouped directly or through others. The merged point is the mean of its group and
    belongs to the marker with the lowest number in it.

    Parameters
    ----------
    points : Points
        Points to merge.
    distance : float
        Distance below which points merge, metres.

    Returns
    -------
    Points
    """
    if not len(points.frames):
        return points
    group = touching(points.places, points.frames, np.full(len(points.frames), distance / 2))
    n_groups = int(group.max()) + 1
    size = np.bincount(group, minlength=n_groups)
    places = np.stack(
        [np.bincount(group, axis, n_groups) / size for axis in points.places.T], axis=1
    )
    order = np.lexsort(
        (np.where(points.markers < 0, np.iinfo(np.int64).max, points.markers), group)
    )
    first = order[np.unique(group[order], return_index=True)[1]]
    alone = size[group[first]] == 1
    places[group[first[alone]]] = points.places[first[alone]]  # to the last bit
    return Points(points.frames[first], places[group[first]], points.markers[first])
