"""False alarms and ghosts of a capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.simulate.corrupted_points import Points, false_points, in_unit_ball
from asterism.simulate.episodes import episodes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.simulate.episodes import Ghosts

__all__ = ["anywhere", "beside", "ghost_points"]


def anywhere(
    rng: np.random.Generator, share: float, margin: float, whole: Points, n_frames: int
) -> Points:
    """Draw clutter, uniform over the bounding box of all points and Poisson in number.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    share : float
        Expected number of false points in a frame, relative to the mean number of markers.
    margin : float
        Extension of the box on every side, metres.
    whole : Points
        Points of the original.
    n_frames : int
        Number of frames.

    Returns
    -------
    Points
    """
    n_markers = int((whole.markers >= 0).sum())
    n_false = rng.poisson(share * n_markers / n_frames, n_frames)
    low, high = whole.places.min(axis=0) - margin, whole.places.max(axis=0) + margin
    places = rng.uniform(low, high, (int(n_false.sum()), len(low)))
    return false_points(np.repeat(np.arange(n_frames), n_false), places)


def beside(
    rng: np.random.Generator,
    share: float,
    nearest: float,
    farthest: float,
    points: Points,
    is_seen: NDArray[np.bool_],
) -> Points:
    """Draw false points that last one frame, each near a detected marker.

    They are drawn for all markers and kept for detected ones, so that the draws do not depend on
    which markers are detected. They are uniform in the volume between the two distances.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    share : float
        Probability that a marker has a false point.
    nearest, farthest : float
        Range of the distance from the marker, metres.
    points : Points
        Points of all markers.
    is_seen : ndarray of bool, shape (N,)
        True for detected points.

    Returns
    -------
    Points
    """
    n, n_axes = points.places.shape
    is_chosen = rng.random(n) < share
    ball = in_unit_ball(rng, n, n_axes)
    radius = np.linalg.norm(ball, axis=1, keepdims=True)
    share_of_volume = radius**n_axes
    far = (nearest**n_axes + (farthest**n_axes - nearest**n_axes) * share_of_volume) ** (1 / n_axes)
    places = points.places + ball / radius * far
    kept = is_chosen & is_seen & (points.markers >= 0)
    return false_points(points.frames[kept], places[kept])


def ghost_points(
    rng: np.random.Generator, ghosts: Ghosts, whole: Points, n_frames: int, n_markers: int
) -> list[Points]:
    """Draw false points that accompany a marker for some frames.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    ghosts : Ghosts
        Number, lifetimes and distances.
    whole : Points
        Points of the original.
    n_frames, n_markers : int
        Numbers of frames and markers.

    Returns
    -------
    list of Points
        One for each ghost.
    """
    is_marker = whole.markers >= 0
    where = np.full((n_frames, n_markers), -1)
    where[whole.frames[is_marker], whole.markers[is_marker]] = np.flatnonzero(is_marker)
    parts: list[Points] = []
    for start, stop in episodes(rng, ghosts, n_frames):
        along = where[start:stop, rng.integers(n_markers)]
        along = along[along >= 0]
        offset = ghosts.within * in_unit_ball(rng, 1, whole.places.shape[1])
        parts.append(false_points(whole.frames[along], whole.places[along] + offset))
    return parts
