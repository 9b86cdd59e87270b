"""Scenes of markers on Lissajous curves: any number of them at constant density.

Motion is defined per frame and `rate` sets the duration of a frame, so a scene is equally difficult
at every rate: a displacement of 0.1 m per frame is a speed of ``0.1 * rate`` m/s.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.simulate.clock import clock
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["dense", "smooth"]


def smooth(
    *,
    n_markers: int = 50,
    frames: int = 100,
    rate: float = 1.0,
    seed: int = 0,
    spacing: float = 0.34,
) -> Truth:
    """Simulate any number of markers on Lissajous curves at constant density.

    On each axis a marker oscillates by 0.1 to 0.3 m at 0.08 to 0.18 rad per frame about a centre of
    its own, so its displacement is below 0.1 m per frame. All drift together by 0.01 m per frame.
    The centres are uniform over a cube with a volume of ``spacing³`` for each marker.

    Parameters
    ----------
    n_markers : int
        Number of markers, ≥ 1.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the centres, the curves and the drift.
    spacing : float
        Typical distance between neighbouring centres, metres, > 0. Smaller values are denser and
        more difficult.

    Returns
    -------
    Truth
        Markers M00, M01 and so on, detected in every frame.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> smooth(n_markers=100, frames=10, seed=1)
    Truth(100 tracks, 1000 detections in them, 0 clutter, 10 frames)
    """
    check_number("n_markers", n_markers, above=1, closed=True, integer=True)
    check_number("spacing", spacing, above=0)
    times = clock(frames, rate, seed)
    rng = np.random.default_rng(seed)
    shape = (n_markers, 3)
    centre = rng.uniform(0.0, spacing * n_markers ** (1 / 3), shape)
    amplitude, omega = rng.uniform(0.1, 0.3, shape), rng.uniform(0.08, 0.18, shape)
    phase = rng.uniform(0, 2 * math.pi, shape)
    heading = rng.uniform(0, 2 * math.pi)
    drift = 0.01 * np.array([math.cos(heading), math.sin(heading), 0.0])
    return Truth.of(times, _lissajous(frames, centre, amplitude, omega, phase, drift))


def dense(
    *,
    n_markers: int = 50,
    frames: int = 200,
    rate: float = 1.0,
    seed: int = 0,
    density: float = 8.0,
) -> Truth:
    """Simulate any number of fast markers that cross each other on smooth paths.

    On each axis a marker oscillates with a peak speed of 0.048 to 0.0866 m per frame at 0.08 to
    0.18 rad per frame. Its displacement per frame is 0.08 m in the mean and at most 0.15 m. The
    centres are uniform over a cube.

    Parameters
    ----------
    n_markers : int
        Number of markers, ≥ 1.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the centres and the curves.
    density : float
        Centres per cubic metre, > 0. Larger values are more difficult.

    Returns
    -------
    Truth
        Markers M00, M01 and so on, detected in every frame.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> dense(n_markers=100, frames=10, seed=1)
    Truth(100 tracks, 1000 detections in them, 0 clutter, 10 frames)
    """
    check_number("n_markers", n_markers, above=1, closed=True, integer=True)
    check_number("density", density, above=0)
    times = clock(frames, rate, seed)
    rng = np.random.default_rng(seed)
    shape = (n_markers, 3)
    centre = rng.uniform(0.0, (n_markers / density) ** (1 / 3), shape)
    omega = rng.uniform(0.08, 0.18, shape)
    amplitude = rng.uniform(0.048, 0.0866, shape) / omega
    phase = rng.uniform(0, 2 * math.pi, shape)
    return Truth.of(times, _lissajous(frames, centre, amplitude, omega, phase, np.zeros(3)))


def _lissajous(
    frames: int,
    centre: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    omega: NDArray[np.float64],
    phase: NDArray[np.float64],
    drift: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Compute the positions of all markers, shape (frames, markers, axes)."""
    positions = np.empty((frames, *centre.shape))
    for now in range(frames):  # frame by frame: there may be very many markers
        positions[now] = centre + now * drift + amplitude * np.sin(omega * now + phase)
    positions.flags.writeable = False  # a read-only array is kept without a copy
    return positions
