"""Scenes of points alone: cubes, walkers, points on smooth paths.

Motion is laid down per frame and `rate` only says how long a frame lasts, so a scene is equally
hard at every rate: what moves 0.1 m a frame moves ``0.1 * rate`` m/s.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.simulate.clock import clock
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["attracted", "crossing", "cube", "smooth", "walk", "wander"]

# Corners of a cube with side 1 about the origin, shape (8, 3), and the pairs along its edges.
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_EDGES = [(i, i + step) for step in (1, 2, 4) for i in range(8) if not i & step]


def cube(
    *, frames: int = 100, rate: float = 1.0, seed: int = 0, side: float = 0.3, speed: float = 0.1
) -> Truth:
    """Make a cube that turns steadily while its centre follows a Lissajous path.

    Parameters
    ----------
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the axis and the path.
    side : float
        Edge of the cube, metres.
    speed : float
        No marker moves more than this from one frame to the next, metres. Three fifths of it go
        to the centre and two to the turning.

    Returns
    -------
    Truth
        8 markers, M00 … M07, at the corners.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """
    check_number("side", side, above=0)
    check_number("speed", speed, above=0, closed=True)
    times = clock(frames, rate, seed)
    t = np.arange(float(frames))
    rng = np.random.default_rng(seed)
    omega = rng.uniform(0.04, 0.08, 3)  # rad a frame: a hundred frames are about one round
    amplitude = 0.6 * speed / math.sqrt(3) / omega
    centre = amplitude * np.sin(t[:, None] * omega + rng.uniform(0, 2 * math.pi, 3))
    spin = 0.4 * speed / (side * math.sqrt(3) / 2)
    turn = _rotations(rng.standard_normal(3), spin * t)
    return _named(times, centre[:, None, :] + _turned(turn, side * _CORNERS), _cube(0, 1))


def crossing(*, frames: int = 60, rate: float = 1.0, seed: int = 0, side: float = 0.25) -> Truth:
    """Make a turning cube that flies through one that stands still.

    It moves 0.02 m a frame along x and turns 0.08 rad a frame about z and half that about y. In
    the middle of the scene both centres would coincide, but for an offset drawn from a normal
    distribution with a standard deviation of 0.025 m an axis.

    Parameters
    ----------
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the offset.
    side : float
        Edge of both cubes, metres.

    Returns
    -------
    Truth
        16 markers: M00 … M07 stand, M08 … M15 fly.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """
    check_number("side", side, above=0)
    times = clock(frames, rate, seed)
    t = np.arange(float(frames))
    offset = np.random.default_rng(seed).normal(0.0, 0.025, 3)
    centre = offset + np.outer(t - (frames - 1) / 2, [0.02, 0.0, 0.0])
    turn = _rotations(np.array([0, 0, 1.0]), 0.08 * t) @ _rotations(np.array([0, 1.0, 0]), 0.04 * t)
    flying = centre[:, None, :] + _turned(turn, side * _CORNERS)
    standing = np.broadcast_to(side * _CORNERS, flying.shape)
    return _named(
        times,
        np.concatenate([standing, flying], axis=1),
        _cube(0, 1) + _cube(8, 2),
        [1] * 8 + [2] * 8,
    )


def smooth(
    *,
    n_markers: int = 50,
    frames: int = 100,
    rate: float = 1.0,
    seed: int = 0,
    spacing: float = 0.34,
) -> Truth:
    """Make any number of markers on Lissajous paths, at a density that does not depend on it.

    On each axis a marker swings by 0.1 to 0.3 m at 0.08 to 0.18 rad a frame about a centre of its
    own, so it moves by less than 0.1 m a frame; all drift together by 0.01 m a frame. The centres
    are spread evenly over a cube with ``spacing³`` of room for each.

    Parameters
    ----------
    n_markers : int
        Number of markers.
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the centres, the paths and the drift.
    spacing : float
        Usual distance between neighbouring centres, metres; smaller is denser and harder.

    Returns
    -------
    Truth
        `n_markers` markers.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """
    check_number("n_markers", n_markers, above=1, closed=True, integer=True)
    check_number("spacing", spacing, above=0)
    times = clock(frames, rate, seed)
    t = np.arange(float(frames))
    rng = np.random.default_rng(seed)
    shape = (n_markers, 3)
    centre = rng.uniform(0.0, spacing * n_markers ** (1 / 3), shape)
    amplitude, omega = rng.uniform(0.1, 0.3, shape), rng.uniform(0.08, 0.18, shape)
    phase = rng.uniform(0, 2 * math.pi, shape)
    heading = rng.uniform(0, 2 * math.pi)
    drift = 0.01 * np.array([math.cos(heading), math.sin(heading), 0.0])
    positions = np.empty((frames, *shape))
    for now, place in zip(t, positions, strict=True):  # in place: there may be very many
        np.multiply(omega, now, out=place)
        place += phase
        np.sin(place, out=place)
        place *= amplitude
        place += centre + now * drift
    return _named(times, positions)


def walk(
    *,
    n_markers: int = 8,
    frames: int = 200,
    rate: float = 1.0,
    seed: int = 0,
    stride: float = 0.02,
    pull: float = 0.0,
) -> Truth:
    """Make markers that walk at random, towards the origin if they are pulled.

    Each frame a marker keeps ``1 - pull`` of its position and takes a normal step. It has no
    velocity to predict from, and the pull brings all of them to one place.

    Parameters
    ----------
    n_markers : int
        Number of markers; they start at the corners of cubes of side 0.3, 0.6, 0.9 … m.
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the steps.
    stride : float
        Standard deviation of a step on each axis, metres.
    pull : float
        Share of its way to the origin that a marker is drawn back each frame, in [0, 1].

    Returns
    -------
    Truth
        `n_markers` markers.

    Raises
    ------
    ParameterError
        If a number is out of range.
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
    return _named(times, positions)


def attracted(*, frames: int = 200, rate: float = 1.0, seed: int = 0) -> Truth:
    """Make 8 markers that walk at random and crowd about the origin: `walk` with a pull of 0.1.

    Parameters
    ----------
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the steps.

    Returns
    -------
    Truth
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
    """Make markers whose speed and direction change all the time, each for itself.

    The velocity of a marker forgets a share `agility` of itself each frame and takes a normal part
    instead; it is drawn back gently to a ball about the origin, and never exceeds `speed`.

    Parameters
    ----------
    n_markers : int
        Number of markers.
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the paths.
    speed : float
        Greatest way from one frame to the next, metres.
    agility : float
        Share of the velocity that is new each frame, in (0, 1].

    Returns
    -------
    Truth
        `n_markers` markers.

    Raises
    ------
    ParameterError
        If a number is out of range.
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
    return _named(times, positions)


def _cube(first: int, colour: int) -> list[tuple[int, int, int]]:
    """Return the lines along the edges of a cube whose first corner is a certain marker."""
    return [(first + i, first + j, colour) for i, j in _EDGES]


def _named(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    lines: Sequence[tuple[int, int, int]] = (),
    colours: Sequence[int] = (),
) -> Truth:
    names = [f"M{i:02d}" for i in range(positions.shape[1])]
    positions.flags.writeable = False  # a read-only array is kept without a copy
    return Truth.of(times, positions, names, lines=lines, colours=colours)


def _rotations(axis: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices about one axis (Rodrigues), shape (T, 3, 3), from angles (T,)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def _turned(turn: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn K points (K, 3) by T rotations (T, 3, 3): shape (T, K, 3)."""
    return np.einsum("tij,kj->tki", turn, points)
