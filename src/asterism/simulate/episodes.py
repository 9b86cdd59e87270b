"""Episodes of a capture: bursts of missed detections, ghosts and visitors, with their times."""

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
    """Markers hidden for a while: behind a limb, at the edge of the volume.

    Parameters
    ----------
    n : int
        At most so many are hidden at a time, half as many on average: each of `n` shadows stays on
        one marker for a while, then rests for a while, both of a length drawn from `shortest` to
        `longest`, then picks another.
    shortest, longest : int
        Length of a while in frames, those of the result where frames are left out.

    Raises
    ------
    ParameterError
        If a number is out of range.
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
    """Short-lived false points that go along with a marker: reflections, wrong intersections.

    Parameters
    ----------
    n : int
        At most so many at a time, half as many on average, timed like `Burst`.
    shortest, longest : int
        Frames that one lasts, those of the result where frames are left out.
    within : float
        Greatest distance from its marker, metres. A ghost keeps its place beside the marker, drawn
        evenly from the ball (the disc in 2-D); where the capture lacks the marker, it is absent.

    Raises
    ------
    ParameterError
        If a number is out of range.
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
    """Markers that enter and leave; one that comes again is another marker.

    Parameters
    ----------
    shortest, longest : int
        Frames that one stays; half as many on average are between its leaving and the next one's
        coming. Those of the result where frames are left out.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    shortest: int = 50
    longest: int = 200

    def __post_init__(self) -> None:
        check_number("shortest", self.shortest, above=1, closed=True, integer=True)
        check_number("longest", self.longest, above=self.shortest, closed=True, integer=True)


def stays(rng: np.random.Generator, visits: Visits, n_frames: int) -> NDArray[np.int64]:
    """Draw when the visitors of one place are there.

    Parameters
    ----------
    rng : Generator
        Random numbers.
    visits : Visits
        How long.
    n_frames : int
        Frames of the capture.

    Returns
    -------
    ndarray of int, shape (M, 2)
        First frame of each visit and the frame after its last; the first is under way at the
        beginning.
    """
    n = n_frames // visits.shortest + 2
    there = rng.integers(visits.shortest, visits.longest, n, endpoint=True)
    away = rng.integers(1, visits.longest, n, endpoint=True) // 2 + 1
    begins = np.cumsum(there + away) - (there + away) - rng.integers(0, there[0])
    both = np.stack([np.maximum(begins, 0), np.minimum(begins + there, n_frames)], axis=1)
    return both[both[:, 0] < both[:, 1]]


def episodes(rng: np.random.Generator, timing: Burst | Ghosts, n_frames: int) -> NDArray[np.int64]:
    """Draw when shadows or ghosts are there.

    Parameters
    ----------
    rng : Generator
        Random numbers.
    timing : Burst or Ghosts
        How many, and how long.
    n_frames : int
        Frames of the capture.

    Returns
    -------
    ndarray of int, shape (M, 2)
        First frame of each episode and the frame after its last.
    """
    n_cycles = n_frames // (2 * timing.shortest) + 2  # enough even if all are of the shortest
    shape = (timing.n, 2 * n_cycles)
    lengths = rng.integers(timing.shortest, timing.longest, shape, endpoint=True)
    # Each starts somewhere inside its first rest, so that not all rest in the first frame.
    edges = np.cumsum(lengths, axis=1) - rng.integers(0, lengths[:, :1], endpoint=True)
    pairs = edges.reshape(-1, 2)
    return np.minimum(pairs[pairs[:, 0] < n_frames], n_frames)
