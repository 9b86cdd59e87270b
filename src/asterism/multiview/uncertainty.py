"""Accuracy of a rig over its volume, and the best position of a further camera."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Camera, Coverage, Rig, intrinsics, volume_grid
from asterism.checks import check_array, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from asterism.camera import Surface

__all__ = ["CameraSuggestion", "TriangulationMap", "suggest_cameras", "triangulation_map"]

_RING, _LEVELS = 24, 3  # candidate positions around the volume, and number of heights
_CELLS = 12  # cells along the longest side of the volume by default


@record(eq=False)
class CameraSuggestion:
    """Candidate for a further camera.

    Attributes
    ----------
    camera : Camera
        The candidate, with its position and direction.
    error : float
        Root mean square error of a point over the volume with this camera, metres. A position that
        the rig does not see has the width of the volume as its standard deviation.
    share : float
        Share of the volume that at least two cameras would see, in [0, 1].

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=4, height=2.5)[:2]
    >>> box = (-1, -1, 0), (1, 1, 2)
    >>> best = am.multiview.triangulation_map(rig, *box, spacing=0.5).suggestions[0]
    >>> best.camera.name, best.share
    ('suggested', 1.0)
    """

    camera: Camera
    error: float
    share: float


@record(eq=False)
class TriangulationMap:
    """Accuracy of a rig over its volume.

    Attributes
    ----------
    coverage : Coverage
        Number of cameras and covariance of a point at each position of a regular grid.
    error : float
        Root mean square error of a point over the volume, metres. A position that the rig does not
        see has the width of the volume as its standard deviation.
    share : float
        Share of the volume that at least two cameras see, in [0, 1].
    suggestions : tuple of CameraSuggestion
        Best positions of one further camera, the best first; each is evaluated on its own.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=4, height=2.5)
    >>> am.multiview.triangulation_map(rig, (-1, -1, 0), (1, 1, 2), spacing=0.5, n_suggestions=0)
    TriangulationMap(125 positions, 100 % seen by two cameras or more, error 1.48 mm
    root mean square, 0 suggestions)
    """

    coverage: Coverage
    error: float
    share: float
    suggestions: tuple[CameraSuggestion, ...]

    def __repr__(self) -> str:
        return (
            f"TriangulationMap({self.coverage.n_cameras.size} positions, {100 * self.share:.3g} % "
            f"seen by two cameras or more, error {1e3 * self.error:.3g} mm root mean square, "
            f"{len(self.suggestions)} suggestions)"
        )


def triangulation_map(
    rig: Rig,
    low: ArrayLike,
    high: ArrayLike,
    *,
    spacing: float | None = None,
    sigma_px: float = 0.3,
    surfaces: Sequence[Surface] = (),
    n_suggestions: int = 1,
) -> TriangulationMap:
    """Compute the accuracy of a rig in a box, and the best position of a further camera.

    Parameters
    ----------
    rig : Rig
        Cameras to evaluate.
    low, high : array_like of shape (3,)
        Corners of the box, world metres.
    spacing : float, optional
        Distance between the positions of the grid, metres, > 0; by default a twelfth of the longest
        side. Smaller values are more accurate and need more time.
    sigma_px : float
        Standard deviation of an image point, pixels per axis, > 0; errors are proportional to it.
    surfaces : sequence of Surface
        Surfaces that may occlude positions.
    n_suggestions : int
        Number of suggested cameras, ≥ 0; the search needs most of the time.

    Returns
    -------
    TriangulationMap
        `asterism.plot.plot_coverage` draws its `coverage`.

    Raises
    ------
    ParameterError
        If the corners span no box, or a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=4, height=2.5)[:2]
    >>> found = am.multiview.triangulation_map(rig, (-1, -1, 0), (1, 1, 2), spacing=0.5)
    >>> bool(found.suggestions[0].error < found.error)
    True
    """
    low, high = check_array("low", low, (3,)), check_array("high", high, (3,))
    longest = float((high - low).max())
    if longest <= 0:
        raise ParameterError("high", f"a corner beyond {low.tolist()}", high.tolist())
    check_number("n_suggestions", n_suggestions, above=0, closed=True, integer=True)
    grid = volume_grid(low, high, longest / _CELLS if spacing is None else spacing)
    coverage = rig.coverage(grid, surfaces, sigma_px=sigma_px)
    width = float(np.linalg.norm(high - low))
    suggestions: tuple[CameraSuggestion, ...] = ()
    if n_suggestions:
        tried = around(rig, low, high)
        best = suggest_cameras(rig, grid, tried, sigma_px=sigma_px, surfaces=surfaces, width=width)
        suggestions = tuple(best[: int(n_suggestions)])
    return TriangulationMap(
        coverage=coverage,
        error=_error(_information(rig, grid.reshape(-1, 3), surfaces, sigma_px), width),
        share=float((coverage.n_cameras >= 2).mean()),
        suggestions=suggestions,
    )


def suggest_cameras(
    rig: Rig,
    points: ArrayLike,
    candidates: Sequence[Camera],
    *,
    sigma_px: float = 0.3,
    surfaces: Sequence[Surface] = (),
    width: float = 1.0,
) -> list[CameraSuggestion]:
    """Rank candidate cameras by the accuracy that each adds to a rig, the best first.

    The measure is the mean square error of a point over the positions (A-optimality). Each position
    has a prior standard deviation of `width`, so that positions that no camera sees count as well.

    Parameters
    ----------
    rig : Rig
        Existing cameras.
    points : array_like of shape (..., 3)
        Positions over which the error is averaged, world metres.
    candidates : sequence of Camera
        Cameras to compare.
    sigma_px : float
        Standard deviation of an image point, pixels per axis, > 0.
    surfaces : sequence of Surface
        Surfaces that may occlude positions.
    width : float
        Prior standard deviation of a position, metres, > 0. Larger values favour candidates that
        see further positions over those that improve the accuracy of seen ones.

    Returns
    -------
    list of CameraSuggestion
        All candidates, the one with the smallest error first.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> import asterism as am
    >>> ring = am.Rig.ring(8, radius=4, height=2.5)
    >>> grid = am.camera.volume_grid((-1, -1, 0), (1, 1, 2), 0.5)
    >>> ranked = am.multiview.suggest_cameras(ring[:2], grid, ring[2:])
    >>> sorted(suggestion.camera.name for suggestion in ranked[:2])
    ['cam4', 'cam7']
    """
    places = check_array("points", np.reshape(points, (-1, 3)), ("N", 3))
    check_number("sigma_px", sigma_px, above=0)
    check_number("width", width, above=0)
    now = _information(rig, places, surfaces, sigma_px)
    n_cameras = rig.project(places, surfaces).visible.sum(axis=0)
    found: list[CameraSuggestion] = []
    for camera in candidates:
        alone = Rig((camera,))
        more = _information(alone, places, surfaces, sigma_px)
        seen = n_cameras + alone.project(places, surfaces).visible[0]
        found.append(
            CameraSuggestion(
                camera=camera, error=_error(now + more, width), share=float((seen >= 2).mean())
            )
        )
    return sorted(found, key=lambda s: s.error)


def around(rig: Rig, low: NDArray[np.float64], high: NDArray[np.float64]) -> list[Camera]:
    """Return cameras like those of a rig, on rings around a box at their heights."""
    middle = (low + high) / 2
    centers = np.stack([camera.center for camera in rig])
    radius = float(np.median(np.linalg.norm((centers - middle)[:, :2], axis=1)))
    radius = max(radius, 0.6 * float(np.linalg.norm((high - low)[:2])))
    heights = np.unique(np.linspace(centers[:, 2].min(), centers[:, 2].max(), _LEVELS).round(6))
    focal = float(np.median([camera.K[0, 0] for camera in rig]))
    w, h = rig[0].size_px
    K = intrinsics(focal_length=focal, principal_point=((w - 1) / 2, (h - 1) / 2))
    cameras: list[Camera] = []
    for z in heights.tolist():
        for angle in 2 * np.pi * np.arange(_RING) / _RING:
            place = middle + radius * np.array([np.cos(angle), np.sin(angle), 0.0])
            place[2] = z
            cameras.append(Camera.look_at(place, middle, K=K, size_px=(w, h), name="suggested"))
    return cameras


def _information(
    rig: Rig, places: NDArray[np.float64], surfaces: Sequence[Surface], sigma_px: float
) -> NDArray[np.float64]:
    """Return the information of all cameras about each position, (N, 3, 3), 1/m²."""
    A = np.zeros((len(places), 3, 3))
    for camera, seen in zip(rig, rig.project(places, surfaces).visible, strict=True):
        J = camera.jacobian(places[seen])
        A[seen] += np.swapaxes(J, 1, 2) @ J / sigma_px**2
    return A


def _error(information: NDArray[np.float64], width: float) -> float:
    P = np.linalg.inv(information + np.eye(3) / width**2)
    return float(np.sqrt(np.trace(P, axis1=1, axis2=2).mean()))
