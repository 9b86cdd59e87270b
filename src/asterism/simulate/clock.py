"""Frame times of all simulated scenes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["clock"]


def clock(frames: int, rate: float, seed: int) -> NDArray[np.float64]:
    """Check the arguments that all scenes share, and return the time of each frame.

    Parameters
    ----------
    frames : int
        Number of frames T, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed, ≥ 0.

    Returns
    -------
    ndarray of shape (T,)
        Seconds.
    """
    check_number("frames", frames, above=1, closed=True, integer=True)
    check_number("rate", rate, above=0)
    check_number("seed", seed, above=0, closed=True, integer=True)
    return np.arange(frames) / rate
