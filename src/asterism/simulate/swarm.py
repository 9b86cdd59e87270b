"""Scene of drones in a room, each with one marker, that alternately spread and gather."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.simulate.clock import clock
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["swarm"]

_PULL, _DAMPING = 3.0, 3.0  # spring constant, 1/s², and damping, 1/s
_REPULSION = 150.0  # m/s² per distance of `apart` below 1.5 `apart`
_STEPS = 8  # integration steps between two frames at 100 Hz


def swarm(
    *,
    n_drones: int = 30,
    frames: int = 600,
    rate: float = 100.0,
    seed: int = 0,
    spacing: float = 1.0,
    apart: float = 0.2,
    period: float = 6.0,
) -> Truth:
    """Simulate drones that spread over a room, gather in its middle and change places.

    Each drone is pulled to its goal like a mass on a damped spring, and repelled by near drones.
    For half of each period the goals are spread; for the other half they are packed as densely as
    the repulsion allows, each time in another order.

    Parameters
    ----------
    n_drones : int
        Number of drones, ≥ 1, with one marker each.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed of the goals.
    spacing : float
        Typical distance between neighbours while they are spread, metres, > 0.
    apart : float
        Distance between neighbours while they are gathered, metres, > 0. Smaller values are more
        difficult.
    period : float
        Time between two gatherings, seconds, > 0.

    Returns
    -------
    Truth
        Markers D00, D01 and so on, detected in every frame.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> swarm(n_drones=4, frames=10, seed=1)
    Truth(4 tracks, 40 detections in them, 0 clutter, 10 frames)
    """
    check_number("n_drones", n_drones, above=1, closed=True, integer=True)
    times = clock(frames, rate, seed)
    for name, value in (("spacing", spacing), ("apart", apart), ("period", period)):
        check_number(name, value, above=0)
    rng = np.random.default_rng(seed)
    room = spacing * n_drones ** (1 / 3)
    n_steps = max(1, round(_STEPS * 100 / rate))
    dt = 1 / (rate * n_steps)
    place = _lattice(n_drones, spacing)[rng.permutation(n_drones)]
    velocity = np.zeros_like(place)
    middle = np.array([0.0, 0.0, 1.0 + room / 2])
    positions = np.empty((frames, n_drones, 3))
    half, goal = -1, place
    for k in range(frames):
        positions[k] = place + middle
        if int(2 * k / (rate * period)) != half:
            half = int(2 * k / (rate * period))
            pitch = apart * 1.25 if half % 2 else spacing
            goal = _lattice(n_drones, pitch)[rng.permutation(n_drones)]
            goal = goal + rng.normal(0.0, 0.05 * pitch, goal.shape)
        for _ in range(n_steps):
            force = _PULL * (goal - place) - _DAMPING * velocity + _push(place, apart)
            velocity = velocity + dt * force
            place = place + dt * velocity
    names = [f"D{i:02d}" for i in range(n_drones)]
    return Truth.of(times, positions, names)


def _lattice(n: int, pitch: float) -> NDArray[np.float64]:
    """Return the `n` places nearest to the origin of a cubic lattice."""
    side = int(np.ceil(n ** (1 / 3))) + 2
    axis = np.arange(side) - (side - 1) / 2
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    order = np.argsort(np.linalg.norm(grid + np.array([0.01, 0.02, 0.03]), axis=1), kind="stable")
    return np.asarray(pitch * grid[order[:n]], dtype=np.float64)


def _push(place: NDArray[np.float64], apart: float) -> NDArray[np.float64]:
    """Return accelerations away from neighbours, which are 0 from a distance of 1.5 `apart`."""
    way = place[:, None] - place[None]
    distance = np.linalg.norm(way, axis=2)
    np.fill_diagonal(distance, np.inf)
    strength = _REPULSION * np.maximum(1.5 - distance / apart, 0.0)
    return np.asarray((strength[..., None] * way / distance[..., None]).sum(axis=1))
