"""Scenes of points without bodies: the cubes of the 2010 report and random walks.

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

__all__ = ["attracted", "crossing", "cube", "walk", "wander"]

# Corners of a cube with side 1 about the origin, shape (8, 3), and the pairs along its edges.
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_EDGES = [(i, i + step) for step in (1, 2, 4) for i in range(8) if not i & step]


def cube(
    *, frames: int = 100, rate: float = 1.0, seed: int = 0, side: float = 0.3, speed: float = 0.1
) -> Truth:
    """Simulate a cube that rotates steadily while its centre follows a Lissajous curve.

    Parameters
    ----------
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the axis and of the curve.
    side : float
        Edge of the cube, metres, > 0.
    speed : float
        Largest displacement of a marker between frames, metres, ≥ 0: three fifths by the centre,
        two fifths by the rotation. The default is a third of the edge, difficult for trackers
        without a velocity.

    Returns
    -------
    Truth
        8 markers, M00 to M07, at the corners.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> cube(frames=10, side=0.2, seed=1)
    Truth(8 tracks, 80 detections in them, 0 clutter, 10 frames)
    """
    check_number("side", side, above=0)
    check_number("speed", speed, above=0, closed=True)
    times = clock(frames, rate, seed)
    t = np.arange(float(frames))
    rng = np.random.default_rng(seed)
    omega = rng.uniform(0.04, 0.08, 3)  # rad per frame: about one cycle in a hundred frames
    amplitude = 0.6 * speed / math.sqrt(3) / omega
    centre = amplitude * np.sin(t[:, None] * omega + rng.uniform(0, 2 * math.pi, 3))
    spin = 0.4 * speed / (side * math.sqrt(3) / 2)
    turn = _rotations(rng.standard_normal(3), spin * t)
    corners = centre[:, None, :] + _turned(turn, side * _CORNERS)
    return Truth.of(times, corners, lines=_cube(0, 1))


def crossing(*, frames: int = 60, rate: float = 1.0, seed: int = 0, side: float = 0.25) -> Truth:
    """Simulate a rotating cube that flies through a stationary one.

    It moves 0.02 m per frame along x and rotates 0.08 rad per frame about z and 0.04 rad about y.
    In the middle of the scene the centres are separated by a random offset with a standard
    deviation of 0.025 m on each axis.

    Parameters
    ----------
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the offset.
    side : float
        Edge of both cubes, metres, > 0. Smaller cubes are denser where they cross.

    Returns
    -------
    Truth
        16 markers: M00 to M07 are stationary, M08 to M15 fly.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> crossing(frames=10, seed=1).names[-1]
    'M15'
    """
    check_number("side", side, above=0)
    times = clock(frames, rate, seed)
    t = np.arange(float(frames))
    offset = np.random.default_rng(seed).normal(0.0, 0.025, 3)
    centre = offset + np.outer(t - (frames - 1) / 2, [0.02, 0.0, 0.0])
    turn = _rotations(np.array([0, 0, 1.0]), 0.08 * t) @ _rotations(np.array([0, 1.0, 0]), 0.04 * t)
    flying = centre[:, None, :] + _turned(turn, side * _CORNERS)
    standing = np.broadcast_to(side * _CORNERS, flying.shape)
    return Truth.of(
        times,
        np.concatenate([standing, flying], axis=1),
        lines=_cube(0, 1) + _cube(8, 2),
        colours=[1] * 8 + [2] * 8,
    )


def walk(
    *,
    n_markers: int = 8,
    frames: int = 200,
    rate: float = 1.0,
    seed: int = 0,
    stride: float = 0.02,
    pull: float = 0.0,
) -> Truth:
    """Simulate markers on a random walk, with an optional pull towards the origin.

    In each frame the position of a marker is multiplied by ``1 - pull`` and a normal step is added.
    There is no velocity to predict from, and the pull brings all markers together.

    Parameters
    ----------
    n_markers : int
        Number of markers, ≥ 1; they start at the corners of cubes of side 0.3, 0.6, 0.9 … m.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the steps.
    stride : float
        Standard deviation of a step on each axis, metres, ≥ 0.
    pull : float
        Share of the position that is removed in each frame, in [0, 1]. Larger values make the
        markers denser.

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
    >>> walk(n_markers=2, frames=3, stride=0.0).positions()[-1]
    array([[-0.15, -0.15, -0.15],
           [-0.15, -0.15,  0.15]])
    """
    check_number("n_markers", n_markers, above=1, closed=True, integer=True)
    check_number("stride", stride, above=0, closed=True)
    check_number("pull", pull, above=0, below=1, closed=True)
    times = clock(frames, rate, seed)
    i = np.arange(n_markers)
    positions = np.empty((frames, n_markers, 3))
    positions[:1] = _CORNERS[i % 8] * 0.3 * (i // 8 + 1)[:, None]
    steps = np.random.default_rng(seed).normal(0.0, stride, positions.shape)
    for k in range(1, frames):
        positions[k] = (1 - pull) * positions[k - 1] + steps[k]
    return Truth.of(times, positions)


def attracted(*, frames: int = 200, rate: float = 1.0, seed: int = 0) -> Truth:
    """Simulate 8 markers on a random walk that crowd about the origin.

    It is `walk` with a pull of 0.1.

    Parameters
    ----------
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0. Motion is defined per frame, so the rate scales the
        speed in m/s only.
    seed : int
        Seed of the steps.

    Returns
    -------
    Truth
        8 markers.

    Examples
    --------
    >>> attracted(frames=10, seed=1)
    Truth(8 tracks, 80 detections in them, 0 clutter, 10 frames)
    """
    return walk(frames=frames, rate=rate, seed=seed, pull=0.1)


def wander(
    *,
    n_markers: int = 8,
    frames: int = 200,
    rate: float = 1.0,
    seed: int = 0,
    speed: float = 0.03,
    agility: float = 0.1,
) -> Truth:
    """Simulate independent markers whose speed and direction change continually.

    In each frame a share `agility` of a marker's velocity is replaced by a normal random part. A
    weak acceleration keeps the markers in a ball about the origin; the speed never exceeds `speed`.

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
        Seed of the paths.
    speed : float
        Largest displacement between frames, metres, > 0.
    agility : float
        Share of the velocity that is new in each frame, in (0, 1]. Larger values are less
        predictable.

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
    >>> wander(n_markers=3, frames=10, rate=100, seed=1).detections
    Detections(10 frames, 30 points, 3-D, 0 to 0.09 s)
    """
    check_number("n_markers", n_markers, above=1, closed=True, integer=True)
    check_number("speed", speed, above=0)
    check_number("agility", agility, above=0, below=1, closed=True)
    times = clock(frames, rate, seed)
    rng = np.random.default_rng(seed)
    room = 0.3 * n_markers ** (1 / 3)
    positions = np.empty((frames, n_markers, 3))
    positions[0] = rng.uniform(-room, room, (n_markers, 3))
    kept, new = 1 - agility, math.sqrt(1 - (1 - agility) ** 2)
    velocity = 0.4 * speed * rng.standard_normal((n_markers, 3))
    for k in range(1, frames):
        velocity = kept * velocity + new * 0.4 * speed * rng.standard_normal((n_markers, 3))
        velocity -= 0.1 * speed * positions[k - 1] / room * agility
        size = np.linalg.norm(velocity, axis=1, keepdims=True)
        velocity *= np.minimum(1.0, speed / np.maximum(size, 1e-300))
        positions[k] = positions[k - 1] + velocity
    return Truth.of(times, positions)


def _cube(first: int, colour: int) -> list[tuple[int, int, int]]:
    """Return the lines along the edges of a cube whose first corner is a certain marker."""
    return [(first + i, first + j, colour) for i, j in _EDGES]


def _rotations(axis: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation matrices about one axis (Rodrigues), (T, 3, 3), from angles (T,)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def _turned(turn: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotate K points (K, 3) by T rotations (T, 3, 3): shape (T, K, 3)."""
    return np.einsum("tij,kj->tki", turn, points)
