"""Shared parts of the readers of calibrations: text to numbers, numbers to cameras and rigs.

Every function reports errors as a `FormatError` with the place in the file.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Camera, Rig
from asterism.errors import FormatError, ParameterError
from asterism.io.units import PER_METRE, judge_unit

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Lens

__all__ = [
    "as_array",
    "build_camera",
    "build_rig",
    "drop_skew",
    "faults_at",
    "nearest_rotation",
    "per_metre",
    "pose",
    "split_numbers",
    "whole_size",
]

_SLACK = 5e-3  # largest entry of RᵀR - I of a rotation written with three decimals
_SMALLEST, _GREATEST = 1e-3, 1e9  # smallest focal length, largest number of any real camera
_MOST_PIXELS = 100_000  # along an edge, the limit of `Camera`


@contextmanager
def faults_at(path: Path, place: str) -> Generator[None, None, None]:
    """Turn a `ParameterError` of the data model into a `FormatError` at a place in a file.

    Parameters
    ----------
    path : Path
        File for the error.
    place : str
        Place in the file.

    Yields
    ------
    None
    """
    try:
        yield
    except ParameterError as error:
        where = f"{place}, {error.name}"
        raise FormatError(path, where, error.expected, error.got, error.hint) from error


def split_numbers(path: Path, place: str, text: str | None, count: int) -> list[float]:
    """Parse a given count of finite numbers.

    Parameters
    ----------
    path, place : Path, str
        File and place for the error.
    text : str or None
        Numbers separated by blanks; None for a missing entry.
    count : int
        Required count.

    Returns
    -------
    list of float
        Parsed numbers.
    """
    wanted = "a number" if count == 1 else f"{count} numbers"
    if text is None:
        raise FormatError(path, place, wanted, "nothing")
    words = text.split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise FormatError(path, place, wanted, repr(text[:60])) from None
    if len(numbers) != count:
        raise FormatError(path, place, wanted, f"{len(numbers)} in {text[:60]!r}")
    if not all(map(math.isfinite, numbers)):
        raise FormatError(path, place, f"{wanted}, finite", repr(text[:60]))
    return numbers


def as_array(
    path: Path, place: str, value: Any, shape: tuple[int, ...] | None = None
) -> NDArray[np.float64]:
    """Convert nested lists of numbers, or of texts of numbers, to an array.

    Parameters
    ----------
    path, place : Path, str
        File and place for the error.
    value : object
        Value read from the file.
    shape : tuple of int, optional
        Required shape. By default one axis of any length.

    Returns
    -------
    ndarray
        Finite numbers.
    """
    wanted = "numbers" if shape is None else f"{' × '.join(map(str, shape))} numbers"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise FormatError(path, place, wanted, repr(value)[:60]) from None
    fits = array.ndim == 1 if shape is None else array.shape == shape
    if value is None or not fits:
        got = "nothing" if value is None else f"{repr(value)[:60]}"
        raise FormatError(path, place, wanted, got)
    if not np.isfinite(array).all():
        raise FormatError(path, place, f"{wanted}, all finite", repr(value)[:60])
    return array


def whole_size(path: Path, place: str, width: float, height: float) -> tuple[int, int]:
    """Check the width and the height of an image.

    Parameters
    ----------
    path, place : Path, str
        File and place for the error.
    width, height : float
        Numbers of the file.

    Returns
    -------
    tuple of int
        Width and height in pixels.
    """
    for value in (width, height):
        if not (math.isfinite(value) and 1 <= value <= _MOST_PIXELS and value == round(value)):
            got = f"{width:g} × {height:g}"
            raise FormatError(path, place, "a width and a height in whole pixels", got)
    return int(width), int(height)


def nearest_rotation(
    path: Path, place: str, matrix: NDArray[np.float64], *, slack: float = _SLACK
) -> NDArray[np.float64]:
    """Return the rotation nearest to a matrix that was written with few decimals.

    Parameters
    ----------
    path, place : Path, str
        File and place for the error.
    matrix : ndarray of shape (3, 3)
        Rotation with rounded entries.
    slack : float
        Largest entry of RᵀR - I that is accepted.

    Returns
    -------
    ndarray of shape (3, 3)
        Proper rotation; `matrix` itself if it is exact.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        away = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if not away <= slack:
        got = f"a matrix whose product with its transpose differs from one by {away:.2g}"
        raise FormatError(path, place, "a rotation", got)
    if np.linalg.det(matrix) < 0:
        hint = "one axis of the world or of the image has the wrong sign"
        raise FormatError(path, place, "a rotation", "a reflection, determinant −1", hint)
    if away < 1e-14:
        return matrix
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def drop_skew(place: str, K: NDArray[np.float64], warnings: list[str]) -> NDArray[np.float64]:
    """Set the skew of a camera matrix to zero, because OpenCV ignores it.

    Parameters
    ----------
    place : str
        Place for the warning.
    K : ndarray of shape (3, 3)
        Camera matrix of the file.
    warnings : list of str
        Receives a warning if the skew is not zero.

    Returns
    -------
    ndarray of shape (3, 3)
        Camera matrix without skew.
    """
    if K[0, 1] != 0:
        warnings.append(f"{place}: the skew {K[0, 1]:g} is ignored, as OpenCV ignores it")
        K = K.copy()
        K[0, 1] = 0.0
    return K


def pose(R: NDArray[np.float64], t: Iterable[float]) -> NDArray[np.float64]:
    """Return the 4 × 4 matrix that rotates by `R` and then shifts by `t`."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = list(t)
    return T


def per_metre(
    units: str | None, centres: Sequence[NDArray[np.float64]], warnings: list[str]
) -> float:
    """Return the number of a file's units per metre, estimated if the unit is not known.

    Parameters
    ----------
    units : str or None
        Unit of the file, None if it is not known.
    centres : sequence of ndarray of shape (3,)
        Positions of the cameras in the units of the file, from which the unit is estimated.
    warnings : list of str
        Receives a warning if the unit was estimated.

    Returns
    -------
    float
        Units per metre.
    """
    if units is None:
        units = judge_unit(np.array(centres).reshape(-1, 3))
        far = max((float(np.abs(centre).max()) for centre in centres), default=0.0)
        warnings.append(
            f"the file names no unit of length: {units} by the cameras' distances "
            f"(largest coordinate {far:.4g}); set units= if that is wrong"
        )
    return PER_METRE[units]


def build_camera(
    path: Path,
    place: str,
    *,
    K: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    size_px: tuple[int, int],
    name: str,
    lens: Lens | None = None,
    K_lens: NDArray[np.float64] | None = None,
) -> Camera:
    """Build a camera, and report a refused value as an error in the file.

    Parameters
    ----------
    path, place : Path, str
        File and place for the error.
    K, T_camera_world, size_px, name, lens, K_lens
        As in `Camera`.

    Returns
    -------
    Camera
        Camera with these values.
    """
    with faults_at(path, place):
        return Camera(
            K=K, T_camera_world=T_camera_world, size_px=size_px, name=name, lens=lens, K_lens=K_lens
        )


def build_rig(path: Path, cameras: Sequence[Camera], warnings: Sequence[str] = ()) -> Rig:
    """Build a rig from the cameras of a file; refuse an empty file and repeated names.

    Parameters
    ----------
    path : Path
        File for the error.
    cameras : sequence of Camera
        Cameras in the order of the file.
    warnings : sequence of str
        Warnings of the reader.

    Returns
    -------
    Rig
        Rig of the cameras.
    """
    if not cameras:
        raise FormatError(path, "its cameras", "at least one", "none")
    names = [camera.name for camera in cameras]
    for i, name in enumerate(names):
        if name and name in names[:i]:
            raise FormatError(path, f"camera {i + 1}", "a unique name", repr(name))
    for i, camera in enumerate(cameras):
        _check_magnitudes(path, f"camera {camera.name or i + 1}", camera)
    with faults_at(path, "the rig"):
        return Rig(cameras=tuple(cameras), warnings=tuple(warnings))


def _check_magnitudes(path: Path, place: str, camera: Camera) -> None:
    """Refuse numbers that no real camera has, because their squares would overflow."""
    numbers = {"K": camera.K, "T_camera_world": camera.T_camera_world}
    if camera.lens is not None:
        numbers |= {"K_lens": camera.lens_matrix, "the lens": camera.lens.coefficients}
    for what, matrix in numbers.items():
        most = float(np.abs(matrix).max())
        if most > _GREATEST:
            raise FormatError(path, f"{place}, {what}", f"numbers under {_GREATEST:g}", f"{most:g}")
    focal = min(float(m[i, i]) for m in (camera.K, camera.lens_matrix) for i in (0, 1))
    if focal < _SMALLEST:
        expected = f"focal lengths over {_SMALLEST:g} pixels"
        raise FormatError(path, f"{place}, K", expected, f"{focal:g}")
