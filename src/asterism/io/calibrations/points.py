"""Known points and their pixels in cameras, to check a calibration."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_fields, check_file
from asterism.errors import FormatError, ParameterError, not_read
from asterism.io.units import PER_METRE, parse_unit
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["Sightings", "read_sightings"]

_COLUMNS = ("camera", "x", "y", "z", "u", "v")
_FLYDRA, _MYPTV = 7, 5  # columns: X Y Z 1 u v 1, and u v X Y Z


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings:
    """Known points in the world and their pixels in one camera.

    Parameters
    ----------
    camera : str
        Name of the camera.
    points : ndarray of shape (N, 3)
        World coordinates, metres.
    pixels : ndarray of shape (N, 2)
        Image points (u, v), pixels from the centre of the top left pixel.
    """

    camera: str
    points: NDArray[np.float64]
    pixels: NDArray[np.float64]


def read_sightings(
    path: Path, cameras: Sequence[str], *, camera: str | None = None, units: str | None = None
) -> list[Sightings]:
    """Read known points with their pixels.

    Parameters
    ----------
    path : Path
        A CSV with columns camera, x, y, z, u, v; or a file of one camera, as flydra
        (``X Y Z 1 u v 1``) or MyPTV (``u v X Y Z``) write them.
    cameras : sequence of str
        Names of the cameras of the rig.
    camera : str, optional
        Camera of the points. By default the camera with whose name the file's name begins.
    units : {"mm", "cm", "m", "in", "ft"}, optional
        Unit of the points. By default metres in a CSV and millimetres in the other formats.

    Returns
    -------
    list of Sightings
        One entry for each camera with points, in the order of `cameras`.

    Raises
    ------
    FormatError
        If the file has none of these formats.
    ParameterError
        If the camera is unknown, or does not follow from the file's name.
    """
    check_file(path)
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "text in UTF-8", error.reason) from error
    except OSError as error:
        raise not_read(path, error) from error
    unit = None if units is None else parse_unit(units)
    if units is not None and unit is None:
        raise ParameterError("units", f"one of {', '.join(PER_METRE)}", repr(units))
    first = text.partition("\n")[0]
    if "," in first:
        rows = _csv(path, text)
        scale = PER_METRE[unit or "m"]
        if camera is not None:
            rows = [row for row in rows if row[0] == camera]
    else:
        name = _whose(path, cameras) if camera is None else camera
        rows = [(name, *numbers) for numbers in _table(path, text)]
        scale = PER_METRE[unit or "mm"]
    check_fields("camera", dict.fromkeys(row[0] for row in rows), cameras)
    found: list[Sightings] = []
    for name in cameras:
        numbers = np.array([row[1:] for row in rows if row[0] == name]).reshape(-1, 5)
        if len(numbers):
            found.append(
                Sightings(camera=name, points=numbers[:, :3] / scale, pixels=numbers[:, 3:])
            )
    if not found:
        raise FormatError(path, "its rows", "known points", "none")
    return found


def _csv(path: Path, text: str) -> list[tuple[str, float, float, float, float, float]]:
    reader = csv.reader(io.StringIO(text))
    rows: list[tuple[str, float, float, float, float, float]] = []
    places: list[int] = []
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if not places:
                names = [cell.lower() for cell in cells]
                missing = [name for name in _COLUMNS if name not in names]
                if missing:
                    got = f"no {', '.join(missing)}"
                    raise FormatError(path, "line 1", f"columns {', '.join(_COLUMNS)}", got)
                places = [names.index(name) for name in _COLUMNS]
            elif any(cells):
                if len(cells) <= max(places):
                    got = f"{len(cells)} cells"
                    expected = "as many as in the header"
                    raise FormatError(path, f"line {reader.line_num}", expected, got)
                x, y, z, u, v = _numbers(path, reader.line_num, [cells[i] for i in places[1:]])
                rows.append((cells[places[0]], x, y, z, u, v))
    except csv.Error as error:
        raise FormatError(path, f"line {reader.line_num}", "CSV", str(error)) from error
    return rows


def _table(path: Path, text: str) -> list[list[float]]:
    rows: list[list[float]] = []
    width = 0
    for i, line in enumerate(text.splitlines()):
        words = line.split()
        if not words:
            continue
        width = width or len(words)
        if width not in (_FLYDRA, _MYPTV) or len(words) != width:
            expected = "X Y Z 1 u v 1, or u v X Y Z, the same in all lines"
            raise FormatError(path, f"line {i + 1}", expected, f"{len(words)} words")
        n = _numbers(path, i + 1, words)
        if width == _MYPTV:
            rows.append([*n[2:], *n[:2]])
        elif n[3] == n[6] == 1:
            rows.append([*n[:3], *n[4:6]])
        else:
            raise FormatError(
                path, f"line {i + 1}", "1 in the fourth and last column", repr(line[:60])
            )
    return rows


def _numbers(path: Path, line: int, words: Sequence[str]) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise FormatError(path, f"line {line}", "numbers", repr(" ".join(words))[:60]) from None
    if not all(map(math.isfinite, numbers)):
        raise FormatError(path, f"line {line}", "finite numbers", repr(" ".join(words))[:60])
    return numbers


def _whose(path: Path, cameras: Sequence[str]) -> str:
    """Return the camera of a file's name: ``cam1_cal_points`` belongs to cam1, or to cam1_0."""
    file = path.name
    word = re.split(r"[._\- ]", file)[0]
    fits = [n for n in cameras if re.match(rf"{re.escape(n)}(?![^\W_])", file)]
    fits = fits or [n for n in cameras if re.match(rf"{re.escape(word)}(?![^\W_])", n)]
    longest = [n for n in fits if len(n) == max(map(len, fits))]
    if len(longest) != 1:
        expected = f"a file whose name begins with that of a camera ({', '.join(cameras)})"
        raise ParameterError("points", expected, repr(file), "or write CAMERA=FILE")
    return longest[0]
