"""What readers of calibrations share: numbers out of text, and cameras and rigs out of numbers.

Every function raises `FormatError` with the place in the file, whatever went wrong.
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
    "read_bytes",
    "split_numbers",
    "whole_size",
]

_LARGEST = 64 << 20  # bytes; a thousand cameras with all their thresholds take less
_SLACK = 5e-3  # how far RᵀR may be from one: what a rotation written with three decimals keeps to
_SMALLEST, _GREATEST = 1e-3, 1e9  # focal length; anything: far beyond what a camera can have
_MOST_PIXELS = 100_000  # along an edge, as `Camera` has it


def read_bytes(path: Path, *, most: int = _LARGEST) -> bytes:
    """Read a whole file, unless it is larger than any calibration.

    Parameters
    ----------
    path : Path
        The file.
    most : int
        Bytes that it may have.

    Returns
    -------
    bytes

    Raises
    ------
    FormatError
        If it has more.
    """
    with path.open("rb") as file:
        raw = file.read(most + 1)
    if len(raw) > most:
        raise FormatError(path, "its length", f"at most {most} bytes", "more")
    return raw


@contextmanager
def faults_at(path: Path, place: str) -> Generator[None, None, None]:
    """Turn what the data model refuses into an error about a place in a file.

    Parameters
    ----------
    path : Path
        The file.
    place : str
        Where in it.

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
    """Read so many finite numbers from text.

    Parameters
    ----------
    path, place : Path, str
        For the error.
    text : str or None
        Numbers with blanks between them; None where there is nothing.
    count : int
        How many there must be.

    Returns
    -------
    list of float
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
    """Make an array of nested lists of numbers, or of words that are numbers.

    Parameters
    ----------
    path, place : Path, str
        For the error.
    value : object
        What a file held.
    shape : tuple of int, optional
        The shape it must have; without, a plain sequence of any length will do.

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
        For the error.
    width, height : float
        As the file has them.

    Returns
    -------
    tuple of int
        The same, pixels.
    """
    for value in (width, height):
        if not (math.isfinite(value) and 1 <= value <= _MOST_PIXELS and value == round(value)):
            got = f"{width:g} × {height:g}"
            raise FormatError(path, place, "a width and a height in whole pixels", got)
    return int(width), int(height)


def nearest_rotation(
    path: Path, place: str, matrix: NDArray[np.float64], *, slack: float = _SLACK
) -> NDArray[np.float64]:
    """Return the rotation next to a matrix that was written with few decimals.

    Parameters
    ----------
    path, place : Path, str
        For the error.
    matrix : ndarray, shape (3, 3)
        Almost a rotation.
    slack : float
        How far its product with its own transpose may be from one.

    Returns
    -------
    ndarray, shape (3, 3)
        A proper rotation; the matrix itself where it is one already.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        away = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if not away <= slack:
        got = f"a matrix whose product with its transpose is {away:.2g} away from one"
        raise FormatError(path, place, "a rotation", got)
    if np.linalg.det(matrix) < 0:
        hint = "one axis of the world or of the image has its sign changed"
        raise FormatError(path, place, "a rotation", "a reflection, determinant −1", hint)
    if away < 1e-14:
        return matrix
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def drop_skew(place: str, K: NDArray[np.float64], warnings: list[str]) -> NDArray[np.float64]:
    """Take the skew out of a matrix of OpenCV's, which itself never looks at it.

    Parameters
    ----------
    place : str
        For the warning.
    K : ndarray, shape (3, 3)
        As the file has it.
    warnings : list of str
        Told where there was one.

    Returns
    -------
    ndarray, shape (3, 3)
    """
    if K[0, 1] != 0:
        warnings.append(f"{place}: the skew {K[0, 1]:g} is left out, as OpenCV leaves it out")
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
    """Say how many of a file's units make a metre, where the file itself does not.

    Parameters
    ----------
    units : str or None
        What the caller knows.
    centres : sequence of ndarray, shape (3,)
        Where the cameras stand, in the units of the file; by them the unit is judged otherwise.
    warnings : list of str
        Told when it had to be judged.

    Returns
    -------
    float
    """
    if units is None:
        units = judge_unit(np.array(centres).reshape(-1, 3))
        far = max((float(np.abs(centre).max()) for centre in centres), default=0.0)
        warnings.append(
            f"the file names no unit of length: {units} by the cameras' distances "
            f"(largest coordinate {far:.4g}); say units= where that is wrong"
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
    """Build a camera; what it refuses is an error about the file.

    Parameters
    ----------
    path, place : Path, str
        For the error.
    K, T_camera_world, size_px, name, lens, K_lens
        As in `Camera`.

    Returns
    -------
    Camera
    """
    with faults_at(path, place):
        return Camera(
            K=K, T_camera_world=T_camera_world, size_px=size_px, name=name, lens=lens, K_lens=K_lens
        )


def build_rig(path: Path, cameras: Sequence[Camera], warnings: Sequence[str] = ()) -> Rig:
    """Build a rig of at least one camera, all with names of their own.

    Parameters
    ----------
    path : Path
        For the error.
    cameras : sequence of Camera
        In the order of the file.
    warnings : sequence of str
        What was odd about it.

    Returns
    -------
    Rig
    """
    if not cameras:
        raise FormatError(path, "its cameras", "at least one", "none")
    names = [camera.name for camera in cameras]
    for i, name in enumerate(names):
        if name and name in names[:i]:
            raise FormatError(path, f"camera {i + 1}", "a name of its own", repr(name))
    for i, camera in enumerate(cameras):
        _check_magnitudes(path, f"camera {camera.name or i + 1}", camera)
    with faults_at(path, "the rig"):
        return Rig(cameras=tuple(cameras), warnings=tuple(warnings))


def _check_magnitudes(path: Path, place: str, camera: Camera) -> None:
    """Refuse numbers of no real camera, whose squares would leave the range of numbers."""
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
