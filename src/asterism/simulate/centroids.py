"""Image formation of markers in motion-capture cameras: blobs and their centroids."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.camera import Reason
from asterism.checks import check_number
from asterism.errors import ParameterError
from asterism.records import record
from asterism.simulate.corrupted_points import touching

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig, Surface

__all__ = ["Blobs", "Seeing", "see"]

_SAMPLES = 13  # points of a marker's disc whose visibility is tested, in a sunflower pattern
_CHUNK = 256  # frames at a time


@record
class Seeing:
    """Image formation of markers in a camera: occlusion, merging and centroid noise.

    Parameters
    ----------
    marker_radius : float
        Radius of a marker, metres; 0 for points. The default is a marker of 14 mm diameter. If the
        centre of a marker is visible, its rim may lie up to three radii inside the surface on which
        it sits without being occluded by it.
    smallest_share : float
        Smallest visible share of a marker that is detected, in [0, 1]. The centroid is that of the
        visible part.
    merge : bool
        Whether blobs that touch in the image become one, at their common centroid.
    noise_px : float
        Standard deviation of a centroid on each axis, pixels, ≥ 0.
    missing : float
        Probability that a camera misses a blob, in [0, 1].
    false : float
        Expected number of false alarms per camera and frame, ≥ 0, uniform over the image.
    quantum_px : float
        Step to which centroids are rounded, pixels; 0 for no rounding.
    timing : float
        Standard deviation of the constant time offset of each camera, seconds; 0 for synchronous
        cameras.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> seeing = am.simulate.Seeing(noise_px=0.5, missing=0.2, false=0.1)
    >>> am.simulate.film(am.simulate.cube(frames=10), rig, seeing=seeing, seed=1)
    Film(4 cameras, 10 frames, 8 markers, 263 image points)
    """

    marker_radius: float = 0.007
    smallest_share: float = 0.3
    merge: bool = True
    noise_px: float = 0.1
    missing: float = 0.0
    false: float = 0.0
    quantum_px: float = 0.0
    timing: float = 0.0

    def __post_init__(self) -> None:
        for name in ("marker_radius", "noise_px", "false", "quantum_px", "timing"):
            check_number(name, getattr(self, name), above=0, closed=True)
        for name in ("smallest_share", "missing"):
            check_number(name, getattr(self, name), above=0, below=1, closed=True)
        check_number("false", self.false, below=1e6)
        if not isinstance(self.merge, bool):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ParameterError("merge", "True or False", repr(self.merge))


class Blobs(NamedTuple):
    """All blobs of all cameras and frames, by frame and camera.

    Attributes
    ----------
    cell : ndarray of int, shape (N,)
        Frame times number of cameras plus camera.
    pixels : ndarray of shape (N, 2)
        Centroids, pixels.
    markers : ndarray of int, shape (N,)
        Marker with the largest part in each blob; -1 for a false alarm.
    blob_of : ndarray of int, shape (C, T, K)
        Blob of each marker, -1 without one.
    share : ndarray of shape (C, T, K)
        Visible share of each marker's disc, 0 without an image.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=3, height=2)
    >>> blobs = see(np.zeros(1), np.ones((1, 1, 3)), rig, (), am.simulate.Seeing(), seed=1)
    >>> blobs.cell.tolist(), blobs.markers.tolist()
    ([0, 1], [0, 0])
    """

    cell: NDArray[np.int64]
    pixels: NDArray[np.float64]
    markers: NDArray[np.int64]
    blob_of: NDArray[np.int64]
    share: NDArray[np.float64]


def see(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    rig: Rig,
    surfaces: Sequence[Surface],
    seeing: Seeing,
    seed: int,
) -> Blobs:
    """Simulate the image formation of markers in every camera.

    Parameters
    ----------
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    positions : ndarray of shape (T, K, 3)
        World metres; NaN for an absent marker.
    rig : Rig
        Cameras that film.
    surfaces : sequence of Surface
        Surfaces that occlude markers.
    seeing : Seeing
        Options of the image formation.
    seed : int
        Seed; each option has its own stream of random numbers, independent of the scenes' streams.

    Returns
    -------
    Blobs

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=3, height=2)
    >>> see(np.zeros(1), np.ones((1, 1, 3)), rig, (), am.simulate.Seeing(), seed=1).pixels.shape
    (2, 2)
    """
    streams = np.random.SeedSequence(seed).spawn(5)
    rng_timing, rng_missing, rng_noise, rng_false, rng_order = map(np.random.default_rng, streams)
    T, K = positions.shape[:2]
    C = len(rig)
    late = seeing.timing * rng_timing.standard_normal(C)
    velocity = _velocity(times, positions) if seeing.timing else None
    centroid, area = np.full((T, C, K, 2), np.nan), np.zeros((T, C, K))
    share = np.zeros((C, T, K))
    for c, camera in enumerate(rig):
        moved = positions if velocity is None else positions + late[c] * velocity
        for begin in range(0, T, _CHUNK):
            rows = np.arange(begin, min(begin + _CHUNK, T))
            here = [s.during(rows) for s in surfaces]
            centroid[rows, c], share[c, rows] = _discs(camera, moved[rows], here, seeing)
            depth = (moved[rows] - camera.center) @ camera.axis
            with np.errstate(divide="ignore", invalid="ignore"):
                radius = seeing.marker_radius * camera.K[0, 0] / depth
            area[rows, c] = share[c, rows] * radius**2
    is_seen = np.isfinite(centroid[..., 0])
    where = np.nonzero(is_seen)
    cell, pixels = where[0] * C + where[1], centroid[where]
    weight = np.maximum(area[where], 1e-12)  # points have no area, so all have one weight
    group = np.arange(len(cell))
    if seeing.merge and len(cell):
        group = touching(pixels, cell, np.sqrt(area[where]))
    n = int(group.max(initial=-1)) + 1
    total = np.bincount(group, weight, n)
    together = np.stack([np.bincount(group, weight * p, n) / total for p in pixels.T], axis=1)
    alone = np.bincount(group, minlength=n)[group] == 1
    together[group[alone]] = pixels[alone]  # to the last bit
    # The largest part is written last, so it determines the marker.
    order = np.lexsort((-where[2], weight))
    markers, cells = np.empty(n, np.int64), np.empty(n, np.int64)
    markers[group[order]], cells[group[order]] = where[2][order], cell[order]

    together += seeing.noise_px * rng_noise.standard_normal((n, 2))
    kept = rng_missing.random(n) >= seeing.missing
    n_false = rng_false.poisson(seeing.false, T * C)
    false_cell = np.repeat(np.arange(T * C), n_false)
    size = np.array([camera.size_px for camera in rig], dtype=np.float64)
    false_pixels = rng_false.random((len(false_cell), 2)) * size[false_cell % C] - 0.5
    all_pixels = np.concatenate([together, false_pixels])
    all_cells = np.concatenate([cells, false_cell])
    if seeing.quantum_px:
        all_pixels = np.rint(all_pixels / seeing.quantum_px) * seeing.quantum_px
    inside = (all_pixels >= -0.5) & (all_pixels < size[all_cells % C] - 0.5)
    kept = np.append(kept, np.ones(len(false_cell), dtype=bool)) & inside.all(axis=1)

    # The order within a cell is random, so that it does not reveal the markers.
    chosen = np.flatnonzero(kept)
    chosen = chosen[np.lexsort((rng_order.random(len(kept))[chosen], all_cells[chosen]))]
    number = np.full(len(kept) + 1, -1)
    number[chosen] = np.arange(len(chosen))
    blob_of = np.full((T, C, K), -1)
    blob_of[where] = number[group]
    return Blobs(
        all_cells[chosen],
        all_pixels[chosen],
        np.append(markers, np.full(len(false_cell), -1))[chosen],
        np.ascontiguousarray(np.swapaxes(blob_of, 0, 1)),
        share,
    )


def _discs(
    camera: Camera, positions: NDArray[np.float64], surfaces: Sequence[Surface], seeing: Seeing
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centroid (T, K, 2) and share (T, K) of the visible part of each marker."""
    r = seeing.marker_radius
    middle = camera.project(positions, surfaces)
    in_view = np.isin(middle.reason, (Reason.VISIBLE, Reason.OCCLUDED))
    if not surfaces or not r:
        share = middle.visible.astype(np.float64)
        return np.where(middle.visible[..., None], middle.pixels, np.nan), share
    towards = positions - camera.center
    with np.errstate(invalid="ignore", divide="ignore"):
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
        right = np.cross(towards, camera.T_camera_world[1, :3])
        right /= np.linalg.norm(right, axis=-1, keepdims=True)
    down = np.cross(towards, right)
    i = np.arange(_SAMPLES)
    turn, reach = i * np.pi * (3 - np.sqrt(5)), r * np.sqrt((i + 0.5) / _SAMPLES)
    offset = (
        np.cos(turn)[:, None] * right[..., None, :] + np.sin(turn)[:, None] * down[..., None, :]
    ) * reach[:, None]
    disc = positions[..., None, :] + offset
    tolerant = camera.project(disc, surfaces, clearance=3 * r)
    exact = camera.project(disc, surfaces)
    # A marker with an occluded centre does not sit on the occluding surface.
    is_occluded = (middle.reason == Reason.OCCLUDED)[..., None]
    seen = np.where(is_occluded, exact.visible, tolerant.visible)
    counted = np.isin(exact.reason, (Reason.VISIBLE, Reason.OCCLUDED))  # inside the image
    with np.errstate(invalid="ignore", divide="ignore"):
        count = seen.sum(axis=-1)
        share = np.where(in_view & (count > 0), count / counted.sum(axis=-1), 0.0)
        part = np.where(seen[..., None], exact.pixels, 0.0).sum(axis=-2) / count[..., None]
    is_seen = (share > 0) & (share >= seeing.smallest_share)
    centroid = np.where((share == 1)[..., None], middle.pixels, part)
    return np.where(is_seen[..., None], centroid, np.nan), share


def _velocity(times: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the velocity of each marker from adjacent frames; 0 if both are missing."""
    if len(times) < 2:
        return np.zeros_like(positions)
    steps = np.diff(positions, axis=0) / np.diff(times)[:, None, None]
    pad = np.full_like(positions[:1], np.nan)
    both = np.stack([np.concatenate([pad, steps]), np.concatenate([steps, pad])])
    known = np.isfinite(both)
    return np.where(known, both, 0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
