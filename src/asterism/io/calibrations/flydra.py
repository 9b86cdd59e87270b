"""Folders of flydra and the Multi-Camera Self-Calibration toolbox.

``camera1.Pmat.cal`` and so on hold one projection matrix each, from world coordinates to pixels of
a camera without distortion. ``name1.rad`` and so on hold the matrix and the coefficients of the
lens, whose centre may differ from the principal point. ``camera_order.txt`` lists the names,
``Res.dat`` the image sizes, ``calibration_units.txt`` the unit of length. If one of these is
absent, the warnings of the rig list the assumed values.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import BrownConrady, Camera
from asterism.errors import FormatError
from asterism.io.calibrations.limits import names_of, refuse_lens
from asterism.io.calibrations.parts import (
    as_array,
    build_rig,
    faults_at,
    per_metre,
    split_numbers,
    whole_size,
)
from asterism.io.units import parse_unit
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Rig

__all__ = ["read", "sniff_folder", "write"]

_PMAT = re.compile(r"camera(\d{1,6})\.Pmat\.cal")
_RAD = re.compile(r".*?(\d{1,6})\.rad")
_ORDER, _SIZES, _UNITS = "camera_order.txt", "Res.dat", "calibration_units.txt"
_LARGEST = 1 << 20  # bytes of one of these small files
_COEFFICIENTS = ("kc1", "kc2", "kc3", "kc4")  # k1, k2, p1, p2


def sniff_folder(folder: Path) -> bool:
    """Return whether a folder holds projection matrices of this format."""
    return any(_PMAT.fullmatch(path.name) for path in folder.iterdir())


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of a flydra folder.

    Parameters
    ----------
    path : Path
        Folder.
    units : str or None
        Unit of length; it overrides ``calibration_units.txt``. None takes the unit from that file,
        or else estimates it from the distances of the cameras.

    Returns
    -------
    Rig
        One camera for each projection matrix.

    Raises
    ------
    FormatError
        If a file is malformed, or if the size of an image is neither given nor implied by a lens.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.io.write_rig(am.Rig.ring(2, radius=3, height=2), folder, format="flydra")
    ...     read(pathlib.Path(folder), None).names
    ('cam1', 'cam2')
    """
    matrices = _by_number(path, _PMAT)
    lenses = _by_number(path, _RAD)
    if not matrices:
        raise FormatError(path, "its files", "camera1.Pmat.cal and so on", "none of them")
    names = _names(path, len(matrices))
    sizes = _sizes(path, len(matrices))
    warnings: list[str] = []
    projections = [_table(file, (3, 4)) for file in matrices.values()]
    if units is None and (path / _UNITS).is_file():
        word = _text(path / _UNITS).strip()
        units = parse_unit(word)
        if units is None:
            raise FormatError(path / _UNITS, "its text", "millimeters or meters", repr(word[:60]))
    centers = [_center(file, P) for file, P in zip(matrices.values(), projections, strict=True)]
    scale = per_metre(units, centers, warnings)
    cameras: list[Camera] = []
    guessed: dict[tuple[int, int], list[str]] = {}
    for i, (number, P) in enumerate(zip(matrices, projections, strict=True)):
        file, lens, K_lens = matrices[number], None, None
        if number in lenses:
            K_lens, lens = _lens(lenses[number])
        if sizes is not None:
            size = sizes[i]
        elif K_lens is not None:
            # The toolbox places the centre of the lens at the centre of the image.
            width, height = (float(np.round(2 * c + 1)) for c in K_lens[:2, 2])
            size = whole_size(lenses[number], "K13 and K23", width, height)
            guessed.setdefault(size, []).append(names[i])
        else:
            hint = f"add {_SIZES} with one line of width and height for each camera"
            raise FormatError(path, f"camera {number}", "the size of its image", "nothing", hint)
        with faults_at(file, "its matrix"):
            cameras.append(Camera.from_matrix(
                P * [scale, scale, scale, 1.0], size_px=size, name=names[i], lens=lens,
                K_lens=None if lens is None else K_lens,
            ))  # fmt: skip
    for (width, height), whose in guessed.items():
        center = f"({(width - 1) / 2:g}, {(height - 1) / 2:g})"
        warnings.append(
            f"no {_SIZES} gives the size of the images: {width} × {height} pixels are assumed for "
            f"{', '.join(whose)}, whose lenses are centred at {center}"
        )
    return build_rig(path, cameras, warnings)


def _by_number(folder: Path, pattern: re.Pattern[str]) -> dict[int, Path]:
    """Return the files of a kind by the number in their names, in its order."""
    found: dict[int, Path] = {}
    for file in sorted(folder.iterdir()):
        match = pattern.fullmatch(file.name)
        if match is None or not file.is_file():
            continue
        number = int(match[1])
        if number in found:
            raise FormatError(
                file,
                "its name",
                "one file for each camera",
                f"camera {number}, which {found[number].name} has too",
            )
        found[number] = file
    return dict(sorted(found.items()))


def _text(file: Path) -> str:
    try:
        return read_bytes(file, most=_LARGEST).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(file, f"byte {error.start}", "text in UTF-8", error.reason) from error


def _table(file: Path, shape: tuple[int, int]) -> NDArray[np.float64]:
    rows = [line.split() for line in _text(file).splitlines() if line.strip()]
    return as_array(file, "its numbers", rows, shape)


def _names(folder: Path, n: int) -> list[str]:
    if not (folder / _ORDER).is_file():
        return [f"camera{i + 1}" for i in range(n)]
    lines = [line.strip() for line in _text(folder / _ORDER).splitlines() if line.strip()]
    if len(lines) != n:
        raise FormatError(folder / _ORDER, "its lines", f"{n} names, a matrix each", len(lines))
    return lines


def _sizes(folder: Path, n: int) -> list[tuple[int, int]] | None:
    file = folder / _SIZES
    if not file.is_file():
        return None
    return [whole_size(file, f"row {i + 1}", *row) for i, row in enumerate(_table(file, (n, 2)))]


def _center(file: Path, P: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(over="ignore", invalid="ignore"):
        try:
            center = np.asarray(np.linalg.solve(P[:, :3], -P[:, 3]), dtype=np.float64)
        except np.linalg.LinAlgError:
            center = np.full(3, np.nan)
    if not np.isfinite(center).all():
        raise FormatError(file, "its matrix", "3 × 3 numbers of rank 3 in front", "a singular one")
    return center


def _lens(file: Path) -> tuple[NDArray[np.float64], BrownConrady | None]:
    """Read a .rad file: lines of a name, "=" and a number."""
    entries: dict[str, str] = {}
    for i, line in enumerate(_text(file).splitlines()):
        if line.strip():
            key, equals, value = line.partition("=")
            if not equals:
                raise FormatError(file, f"line {i + 1}", "a name = a number", repr(line[:60]))
            entries[key.strip()] = value
    K = np.array([
        [split_numbers(file, f"K{i}{j}", entries.get(f"K{i}{j}"), 1)[0] for j in (1, 2, 3)]
        for i in (1, 2, 3)
    ])  # fmt: skip
    k = [split_numbers(file, key, entries.get(key), 1)[0] for key in _COEFFICIENTS]
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        got = f"{K[0, 0]:g} and {K[1, 1]:g}"
        raise FormatError(file, "K11 and K22", "focal lengths > 0", got)
    if any(k) and K[0, 1] != 0:
        # The toolbox uses the skew when it distorts a point, but not when it corrects one.
        raise FormatError(file, "K12", "0 beside a lens", f"{K[0, 1]:g}")
    return K, BrownConrady(*k) if any(k) else None


def write(rig: Rig) -> dict[str, bytes]:
    """Encode a rig as a flydra folder in millimetres.

    Parameters
    ----------
    rig : Rig
        Cameras without a lens, or with a `BrownConrady` lens about any centre, without k3 and
        without skew.

    Returns
    -------
    dict of str to bytes
        Content of each file of the folder, by its name.

    Raises
    ------
    ParameterError
        If the format cannot hold a lens, or if two cameras have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> sorted(write(am.Rig.ring(1, radius=3, height=2)))[:3]
    ['Res.dat', 'basename1.rad', 'calibration_units.txt']
    """
    names = names_of(rig)
    files = {_ORDER: "".join(f"{name}\n" for name in names), _UNITS: "millimeters\n"}
    files[_SIZES] = "".join(f"{width} {height}\n" for width, height in (c.size_px for c in rig))
    for i, camera in enumerate(rig):
        P = camera.K @ camera.T_camera_world[:3] * [1e-3, 1e-3, 1e-3, 1]
        rows = (" ".join(f"{x:.17e}" for x in row) for row in P)
        files[f"camera{i + 1}.Pmat.cal"] = "\n".join(rows) + "\n"
        K = camera.K if camera.K_lens is None else camera.K_lens
        entries = {f"K{r + 1}{c + 1}": K[r, c] for r in range(3) for c in range(3)}
        entries |= dict(zip(_COEFFICIENTS, _coefficients(camera, K), strict=True))
        lines = (f"{key} = {float(value)!r}\n" for key, value in entries.items())
        files[f"basename{i + 1}.rad"] = "".join(lines)
    return {name: text.encode() for name, text in files.items()}


def _coefficients(camera: Camera, K_lens: NDArray[np.float64]) -> list[float]:
    lens, wanted = camera.lens, "BrownConrady with k3 = 0"
    if lens is None:
        return [0.0] * 4
    if not isinstance(lens, BrownConrady):
        refuse_lens(camera, "flydra", wanted, type(lens).__name__, "BrownConrady")
    if lens.k3 != 0:
        refuse_lens(camera, "flydra", wanted, f"k3 = {lens.k3:g}", "BrownConrady")
    if K_lens[0, 1] != 0:
        refuse_lens(camera, "flydra", wanted, "one in coordinates with skew", "BrownConrady")
    return [lens.k1, lens.k2, lens.p1, lens.p2]
