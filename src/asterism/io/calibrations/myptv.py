"""Camera files of MyPTV's Tsai model, a folder of them or a single one.

Lengths are millimetres unless said otherwise. A file has ten lines: a title, the name, the size of
the image, the camera's centre, three angles of the rotation Rx·Ry·Rz from world to camera, the
focal length in pixels, the principal point relative to the middle (width / 2, height / 2) of the
image, and three rows of five coefficients that correct raw pixels (u, v, u², v², u v).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import QuadraticCorrection
from asterism.errors import FormatError, ParameterError
from asterism.io.calibrations.limits import names_of, refuse_lens
from asterism.io.calibrations.parts import (
    build_camera,
    build_rig,
    pose,
    split_numbers,
    whole_size,
)
from asterism.io.units import PER_METRE, from_metres
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig

__all__ = ["read", "sniff", "sniff_folder", "write"]

_TITLE = "Tsai model camera"
_LARGEST = 1 << 16  # bytes
_LINES = ("title", "name", "resolution", "centre", "angles", "focal length", "principal point",
          "first row of E", "second row of E", "third row of E")  # fmt: skip


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a MyPTV camera file."""
    return head.lstrip().startswith(_TITLE.encode())


def sniff_folder(folder: Path) -> bool:
    """Return whether a folder holds a MyPTV camera file."""
    return any(_is_camera(path) for path in folder.iterdir())


def _is_camera(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return sniff(file.read(len(_TITLE) + 16))


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of MyPTV's Tsai model.

    Parameters
    ----------
    path : Path
        Folder of camera files, or the file of one camera.
    units : str or None
        Unit of length; None is "mm", the unit of MyPTV's own calibrations.

    Returns
    -------
    Rig
        Cameras in the order of the names of their files; ``cam10`` comes after ``cam9``.

    Raises
    ------
    FormatError
        If a file is malformed, or if the third row of the correction is not zero.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     am.io.write_rig(am.Rig.ring(2, radius=3, height=2), folder, format="myptv")
    ...     read(pathlib.Path(folder), None).names
    ('cam1', 'cam2')
    """
    scale = PER_METRE[units or "mm"]
    files = [path]
    if path.is_dir():
        found = (file for file in path.iterdir() if _is_camera(file))
        files = sorted(found, key=lambda file: _natural(file.name))
    return build_rig(path, [_camera(file, scale) for file in files])


def _natural(name: str) -> list[tuple[bool, int, str]]:
    parts = re.split(r"(\d+)", name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts]


def _camera(file: Path, scale: float) -> Camera:
    try:
        text = read_bytes(file, most=_LARGEST).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(file, f"byte {error.start}", "text in UTF-8", error.reason) from error
    lines = text.splitlines()
    if not lines or lines[0].strip() != _TITLE:
        got = repr(lines[0][:60]) if lines else "nothing"
        raise FormatError(file, "line 1", repr(_TITLE), got)

    def numbers(i: int, count: int) -> list[float]:
        line = lines[i] if i < len(lines) else None
        return split_numbers(file, f"line {i + 1}, {_LINES[i]}", line, count)

    name = lines[1].strip() if len(lines) > 1 else ""
    size = whole_size(file, f"line 3, {_LINES[2]}", *numbers(2, 2))
    center = np.array(numbers(3, 3)) / scale
    R = _rotation(*numbers(4, 3))
    (focal,) = numbers(5, 1)
    K = np.array([[focal, 0, 0], [0, focal, 0], [0, 0, 1]])
    K[:2, 2] = np.array(size) / 2 + numbers(6, 2)
    ex, ey, ez = (numbers(i, 5) for i in (7, 8, 9))
    if any(ez):
        hint = "a focal length that depends on the pixel is not supported"
        raise FormatError(file, f"line 10, {_LINES[9]}", "zeros", repr(lines[9][:60]), hint)
    lens = QuadraticCorrection(ex=_five(ex), ey=_five(ey)) if any(ex) or any(ey) else None
    return build_camera(
        file, f"camera {name}", K=K, T_camera_world=pose(R, -R @ center), size_px=size, name=name,
        lens=lens, K_lens=None if lens is None else np.eye(3),
    )  # fmt: skip


def _five(row: list[float]) -> tuple[float, float, float, float, float]:
    a, b, c, d, e = row
    return a, b, c, d, e


def _rotation(x: float, y: float, z: float) -> NDArray[np.float64]:
    cx, cy, cz = np.cos([x, y, z])
    sx, sy, sz = np.sin([x, y, z])
    Rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return Rx @ Ry @ Rz


def _angles(R: NDArray[np.float64]) -> list[float]:
    """Return the angles of `_rotation`; if y is a right angle, z is arbitrary.

    The first angle is computed from the rotation that remains after the other two are undone. Its
    own entries of the matrix are too small when y is near a right angle.
    """
    y = np.arctan2(R[0, 2], np.hypot(R[0, 0], R[0, 1]))
    z = np.arctan2(-R[0, 1], R[0, 0])
    rest = R @ _rotation(0.0, y, z).T
    return [float(np.arctan2(rest[2, 1], rest[1, 1])), float(y), float(z)]


def write(rig: Rig) -> dict[str, bytes]:
    """Encode a rig as a folder of MyPTV camera files in millimetres.

    Parameters
    ----------
    rig : Rig
        Cameras without a lens, or with a `QuadraticCorrection` of raw pixels (`K_lens` is the
        identity).

    Returns
    -------
    dict of str to bytes
        Content of each camera's file, by the name of the camera.

    Raises
    ------
    ParameterError
        If the format cannot hold a lens, or if a name is repeated or cannot be a file name.

    Examples
    --------
    >>> import asterism as am
    >>> write(am.Rig.ring(1, radius=3, height=2))["cam1"].decode().splitlines()[0]
    'Tsai model camera'
    """
    files: dict[str, bytes] = {}
    for camera, name in zip(rig, names_of(rig), strict=True):
        if re.fullmatch(r"[\w\- ][\w\-. ]*", name) is None or name != name.strip():
            expected = "a valid file name: letters, digits, blanks, '-', '_' and '.'"
            raise ParameterError(f"the name of camera {name!r}", expected, repr(name))
        ex, ey = _rows(camera)
        # The format has one focal length and no skew. The rest of K is moved to the correction,
        # whose terms of first order have the same effect on a pixel.
        (fx, skew, u0), (_, fy, v0) = camera.K[:2].tolist()
        ey = ey * (fx / fy) + np.array([0, fx / fy - 1, 0, 0, 0])
        v0 *= fx / fy
        if skew:
            ex = ex - skew / fx * ey - np.array([0, skew / fx, 0, 0, 0])
            u0 -= skew / fx * v0
        middle = np.array(camera.size_px) / 2
        center = from_metres(np.array(camera.center, dtype=np.float64), "mm")
        rows = [
            camera.size_px, center, _angles(camera.T_camera_world[:3, :3]), [fx],
            [u0 - middle[0], v0 - middle[1]], ex, ey, [0.0] * 5,
        ]  # fmt: skip
        lines = [_TITLE, name, *(" ".join(map(_digits, row)) + " " for row in rows)]
        files[name] = ("\n".join(lines) + "\n").encode()
    return files


def _digits(number: float) -> str:
    return str(int(number)) if isinstance(number, (int, np.integer)) else repr(float(number))


def _rows(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    lens, wanted = camera.lens, "QuadraticCorrection of raw pixels (K_lens one)"
    if lens is None:
        return np.zeros(5), np.zeros(5)
    if not isinstance(lens, QuadraticCorrection):
        refuse_lens(camera, "myptv", wanted, type(lens).__name__, "QuadraticCorrection")
    if camera.K_lens is None or not np.array_equal(camera.K_lens, np.eye(3)):
        got = "one in other coordinates"
        refuse_lens(camera, "myptv", wanted, got, "QuadraticCorrection")
    return np.array(lens.ex, dtype=np.float64), np.array(lens.ey, dtype=np.float64)
