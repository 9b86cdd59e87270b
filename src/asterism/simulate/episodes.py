"""Episodes of a capture: bursts of missed detections, ghosts and visits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Burst", "Ghosts", "Visits", "episodes", "stays"]


@record
class Burst:
    """Bursts of missed detections, as of markers occluded by a limb.

    Each of `n` shadows occludes one random marker for a random time, pauses for a random time, and
    continues with another marker.

    Parameters
    ----------
    n : int
        Largest number of markers that are occluded at the same time, ≥ 0; half as many on average.
    shortest, longest : int
        Range of the lengths of occlusions and pauses, frames of the result, ≥ 1.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> burst = am.simulate.Burst(n=2, shortest=10, longest=30)
    >>> am.simulate.corrupt(am.simulate.cube(seed=1), burst=burst, seed=1)
    Truth(8 tracks, 698 detections in them, 0 clutter, 100 frames)
    """

    n: int = 5
    shortest: int = 5
    longest: int = 60

    def __post_init__(self) -> None:
        check_number("n", self.n, above=0, closed=True, integer=True)
        check_number("shortest", self.shortest, above=1, closed=True, integer=True)
        check_number("longest", self.longest, above=self.shortest, closed=True, integer=True)


@record
class Ghosts:
    """Ghosts: false points that accompany a marker, such as reflections or wrong intersections.

    Parameters
    ----------
    n : int
        Largest number of ghosts at the same time, ≥ 0; half as many on average, timed as in
        `Burst`.
    shortest, longest : int
        Range of the lifetimes of a ghost, frames of the result, ≥ 1.
    within : float
        Largest distance from the marker, metres, > 0. A ghost keeps its offset from the marker,
        which is uniform in the ball (2-D: the disc), and is absent where the marker is absent.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> ghosts = am.simulate.Ghosts(n=2, within=0.02)
    >>> am.simulate.corrupt(am.simulate.cube(seed=1), ghosts=ghosts, seed=1)
    Truth(8 tracks, 800 detections in them, 102 clutter, 100 frames)
    """

    n: int = 3
    shortest: int = 1
    longest: int = 10
    within: float = 0.05

    def __post_init__(self) -> None:
        check_number("n", self.n, above=0, closed=True, integer=True)
        check_number("shortest", self.shortest, above=1, closed=True, integer=True)
        check_number("longest", self.longest, above=self.shortest, closed=True, integer=True)
        check_number("within", self.within, above=0)


@record
class Visits:
    """Visits: markers that enter and leave. A marker that returns counts as another marker.

    Parameters
    ----------
    shortest, longest : int
        Range of the lengths of a visit, frames of the result, ≥ 1. Pauses between visits are half
        as long on average.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> visits = am.simulate.Visits(shortest=20, longest=40)
    >>> am.simulate.corrupt(am.simulate.cube(seed=1), visits=visits, seed=1).names[:3]
    ('M00/1', 'M00/2', 'M00/3')
    """

    shortest: int = 50
    longest: int = 200

    def __post_init__(self) -> None:
        check_number("shortest", self.shortest, above=1, closed=True, integer=True)
        check_number("longest", self.longest, above=self.shortest, closed=True, integer=True)


def stays(rng: np.random.Generator, visits: Visits, n_frames: int) -> NDArray[np.int64]:
    """Draw the times of successive visits of one marker.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    visits : Visits
        Lengths of the visits.
    n_frames : int
        Number of frames of the capture.

    Returns
    -------
    ndarray of int, shape (M, 2)
        First frame of each visit and the frame after its last; the first visit has started before
        frame 0.

    Examples
    --------
    >>> stays(np.random.default_rng(1), Visits(shortest=20, longest=40), 100).shape[1]
    2
    """
    n = n_frames // visits.shortest + 2
    there = rng.integers(visits.shortest, visits.longest, n, endpoint=True)
    away = rng.integers(1, visits.longest, n, endpoint=True) // 2 + 1
    begins = np.cumsum(there + away) - (there + away) - rng.integers(0, there[0])
    both = np.stack([np.maximum(begins, 0), np.minimum(begins + there, n_frames)], axis=1)
    return both[both[:, 0] < both[:, 1]]


def episodes(rng: np.random.Generator, timing: Burst | Ghosts, n_frames: int) -> NDArray[np.int64]:
    """Draw the times of bursts or ghosts.

    Parameters
    ----------
    rng : Generator
        Generator of random numbers.
    timing : Burst or Ghosts
        Number and lengths of the episodes.
    n_frames : int
        Number of frames of the capture.

    Returns
    -------
    ndarray of int, shape (M, 2)
        First frame of each episode and the frame after its last.

    Examples
    --------
    >>> found = episodes(np.random.default_rng(1), Burst(n=1, shortest=5, longest=5), 30)
    >>> int((found[:, 1] - found[:, 0]).max())
    5
    """
    n_cycles = n_frames // (2 * timing.shortest) + 2  # enough if all have the shortest length
    shape = (timing.n, 2 * n_cycles)
    lengths = rng.integers(timing.shortest, timing.longest, shape, endpoint=True)
    # Each starts at a random time within its first pause, so that not all pause in frame 0.
    edges = np.cumsum(lengths, axis=1) - rng.integers(0, lengths[:, :1], endpoint=True)
    pairs = edges.reshape(-1, 2)
    return np.minimum(pairs[pairs[:, 0] < n_frames], n_frames)
