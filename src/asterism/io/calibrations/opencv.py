"""YAML of OpenCV's FileStorage: one camera in a file, or several in named mappings."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from asterism.camera import BrownConrady
from asterism.errors import FormatError
from asterism.io.calibrations.limits import brown_coefficients, names_of, no_skew
from asterism.io.calibrations.parts import (
    as_array,
    build_camera,
    build_rig,
    drop_skew,
    nearest_rotation,
    per_metre,
    pose,
    split_numbers,
    whole_size,
)
from asterism.io.units import parse_unit
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig

__all__ = ["read", "sniff", "write"]

_LARGEST = 2 << 20  # bytes: the parser is slow and takes about ten seconds for this many

# Spellings found in files, compared in lower case without "_" and "-".
_K = ("cameramatrix", "k", "matrix", "intrinsicmatrix", "intrinsics", "mtx")
_D = ("distortioncoefficients", "distcoeffs", "distortioncoeffs", "distcoefs", "distcoeff",
      "distortions", "distortion", "dist", "d")  # fmt: skip
_R = ("r", "rvec", "rotation", "rotationmatrix", "rotationvector", "rmat")
_T = ("t", "tvec", "translation", "translationvector")
_WIDTH = ("imagewidth", "width", "imgwidth")
_HEIGHT = ("imageheight", "height", "imgheight")
_SIZE = ("imagesize", "size", "resolution", "imgsize")
_NAME = ("name", "cameraname")
_MODEL = ("distortionmodel", "cameramodel", "cameratype", "modeltype")


class _Loader(yaml.BaseLoader):
    """Loader of texts, lists and mappings that ignores tags and refuses aliases.

    By an alias a list can contain itself, or grow without limit. No calibration needs one.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.MarkedYAMLError(problem="an alias", problem_mark=mark)
        return super().compose_node(parent, index)


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of an OpenCV FileStorage."""
    return head.lstrip(b"\xef\xbb\xbf").startswith(b"%YAML") or b"opencv-matrix" in head


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of an OpenCV FileStorage in YAML.

    Parameters
    ----------
    path : Path
        YAML file.
    units : str or None
        Unit of length of the file. None takes it from the entry ``units``, or else estimates it
        from the distances of the cameras.

    Returns
    -------
    Rig
        Cameras of the file. A single camera without a pose is placed at the origin, with a warning.

    Raises
    ------
    FormatError
        If the file is not plain YAML, has no camera matrix or image size, or has a camera model
        other than a pinhole with up to five coefficients of distortion.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cameras.yml")
    ...     _ = path.write_bytes(write(am.Rig.ring(2, radius=3, height=2)))
    ...     read(path, None).names
    ('cam1', 'cam2')
    """
    content = _load(path)
    warnings: list[str] = []
    flat = _plain_keys(content)
    if units is None and isinstance(flat.get("units"), str):
        units = parse_unit(flat["units"])
    if _pick(flat, _K) is not None:
        found = [_camera(path, path.stem, flat, warnings)]
    else:
        tables = {key: _plain_keys(v) for key, v in content.items() if isinstance(v, dict)}
        found = [
            _camera(path, k, v, warnings) for k, v in tables.items() if _pick(v, _K) is not None
        ]
    if not found:
        expected = "a camera_matrix, at the top or within named mappings"
        raise FormatError(path, "its entries", expected, ", ".join(map(str, content))[:60])
    if len(found) == 1 and found[0]["R"] is None:
        warnings.append("the file has no pose: the camera is at the origin and looks along z")
        found[0] |= {"R": np.eye(3), "t": np.zeros(3)}
        units = units or "m"
    for f in found:
        if f["R"] is None:
            raise FormatError(path, f["place"], "a rotation and a translation", "none")
    scale = per_metre(units, [-f["R"].T @ f["t"] for f in found], warnings)
    cameras: list[Camera] = [
        build_camera(
            path, f["place"], K=f["K"], T_camera_world=pose(f["R"], f["t"] / scale),
            size_px=f["size"], name=f["name"], lens=f["lens"],
        )
        for f in found
    ]  # fmt: skip
    return build_rig(path, cameras, warnings)


def _load(path: Path) -> dict[str, Any]:
    raw = read_bytes(path, most=_LARGEST)
    try:
        text = raw.decode("utf-8-sig")
        # OpenCV's first line, "%YAML:1.0", is not valid YAML 1.1.
        text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
        content = yaml.load(text, Loader=_Loader)
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "text in UTF-8", error.reason) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = "its text" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}"
        raise FormatError(path, place, "plain YAML", error.problem or str(error)) from error
    except (yaml.YAMLError, ValueError) as error:
        raise FormatError(path, "its text", "YAML", str(error).splitlines()[0]) from error
    except RecursionError:
        raise FormatError(
            path, "its nesting", "mappings and matrices", "hundreds of levels"
        ) from None
    if not isinstance(content, dict):
        raise FormatError(path, "its text", "a mapping of names to values", repr(content)[:60])
    return {str(key): value for key, value in content.items()}


def _plain_keys(entry: dict[Any, Any]) -> dict[str, Any]:
    return {re.sub(r"[_\- ]", "", str(key)).lower(): value for key, value in entry.items()}


def _pick(entry: dict[str, Any], names: tuple[str, ...]) -> Any:
    return next((entry[name] for name in names if name in entry), None)


def _matrix(path: Path, place: str, value: Any) -> NDArray[np.float64]:
    """Read a matrix as FileStorage writes it, or plain lists."""
    if not isinstance(value, dict):
        array = as_array(path, place, _flat(value))
        nested = isinstance(value, list) and value and isinstance(value[0], list)
        return array.reshape(len(value), -1) if nested and len(array) % len(value) == 0 else array
    data = as_array(path, f"{place}, data", value.get("data"))
    shape = [int(split_numbers(path, f"{place}, {k}", _word(value.get(k)), 1)[0])
             for k in ("rows", "cols")]  # fmt: skip
    if min(shape) < 0 or shape[0] * shape[1] != len(data):
        got = f"{len(data)}"
        raise FormatError(path, f"{place}, data", f"{shape[0]} × {shape[1]} numbers", got)
    return data.reshape(shape)


def _flat(value: Any) -> Any:
    """Make one list of a list of lists."""
    if isinstance(value, list) and any(isinstance(row, list) for row in value):
        return [x for row in value for x in (row if isinstance(row, list) else [row])]
    return value


def _word(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _camera(path: Path, key: str, entry: dict[str, Any], warnings: list[str]) -> dict[str, Any]:
    name = _word(_pick(entry, _NAME)) or key
    place = f"camera {name}"
    model = str(_pick(entry, _MODEL) or "").lower()
    if str(entry.get("fisheye", "0")).lower() not in ("0", "false", "no"):
        model = "fisheye"
    if any(word in model for word in ("fisheye", "equi", "omni", "kannala")):
        expected = "a pinhole with distortion k1, k2, p1, p2, k3"
        raise FormatError(path, f"{place}, camera model", expected, repr(model[:60]))
    K = _matrix(path, f"{place}, camera matrix", _pick(entry, _K))
    if K.size != 9:
        raise FormatError(path, f"{place}, camera matrix", "3 × 3 numbers", f"{K.size} numbers")
    distortion = _pick(entry, _D)
    k = np.zeros(5)
    if distortion is not None:
        given = _matrix(path, f"{place}, distortion coefficients", distortion).ravel()
        if given[5:].any():
            expected = "k1, k2, p1, p2, k3, followed by zeros only"
            got, hint = f"{len(given)} numbers", "calibrate with five coefficients"
            raise FormatError(path, f"{place}, distortion coefficients", expected, got, hint)
        k[: len(given[:5])] = given[:5]
    R, t = _pick(entry, _R), _pick(entry, _T)
    if (R is None) != (t is None):
        got = "only one of them"
        raise FormatError(path, place, "a rotation and a translation, or neither", got)
    if R is not None:
        R = _rotation(path, f"{place}, rotation", _matrix(path, f"{place}, rotation", R))
        t = _matrix(path, f"{place}, translation", t).ravel()
        if t.size != 3:
            raise FormatError(path, f"{place}, translation", "3 numbers", f"{t.size}")
    return {
        "place": place, "name": name, "size": _size(path, place, entry),
        "K": drop_skew(place, K.reshape(3, 3), warnings),
        "lens": BrownConrady(*k.tolist()) if k.any() else None, "R": R, "t": t,
    }  # fmt: skip


def _rotation(path: Path, place: str, value: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    if value.size == 3:
        return Rotation.from_rotvec(value.ravel()).as_matrix()
    if value.size != 9:
        raise FormatError(path, place, "3 × 3 numbers, or a vector of 3", f"{value.size} numbers")
    return nearest_rotation(path, place, value.reshape(3, 3))


def _size(path: Path, place: str, entry: dict[str, Any]) -> tuple[int, int]:
    width, height = _word(_pick(entry, _WIDTH)), _word(_pick(entry, _HEIGHT))
    if width is None or height is None:
        both = _pick(entry, _SIZE)
        if both is None:
            expected, hint = "image_width and image_height", "add them as two lines"
            raise FormatError(path, place, expected, "neither", hint)
        size = _matrix(path, f"{place}, image size", both).ravel()
        if len(size) != 2:
            raise FormatError(path, f"{place}, image size", "2 numbers", f"{len(size)}")
        return whole_size(path, f"{place}, image size", *size.tolist())
    place = f"{place}, image size"
    sides = (split_numbers(path, place, side, 1)[0] for side in (width, height))
    return whole_size(path, place, *sides)


def write(rig: Rig) -> bytes:
    """Encode a rig as an OpenCV FileStorage in metres, with one mapping for each camera.

    Parameters
    ----------
    rig : Rig
        Cameras without skew, and without a lens or with a `BrownConrady` lens in the coordinates
        of K.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    ParameterError
        If a camera has skew or another lens, or if two cameras have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> write(am.Rig.ring(1, radius=3, height=2)).decode().splitlines()[2:4]
    ['units: "metres"', 'camera_0:']
    """
    lines = ["%YAML:1.0", "---", 'units: "metres"']
    for i, (camera, name) in enumerate(zip(rig, names_of(rig), strict=True)):
        no_skew(camera, "opencv")
        quoted = name.replace("\\", "\\\\").replace('"', '\\"')
        lines += [f"camera_{i}:", f'   name: "{quoted}"']
        for key, pixels in zip(("image_width", "image_height"), camera.size_px, strict=True):
            lines.append(f"   {key}: {pixels}")
        lines += _lines("camera_matrix", camera.K)
        coefficients = brown_coefficients(camera, "opencv")
        lines += _lines("distortion_coefficients", coefficients[:, np.newaxis])
        lines += _lines("R", camera.T_camera_world[:3, :3])
        lines += _lines("T", camera.T_camera_world[:3, 3:])
    return ("\n".join(lines) + "\n").encode()


def _lines(key: str, matrix: NDArray[np.float64]) -> list[str]:
    rows, columns = matrix.shape
    numbers = ", ".join(f"{x:.17e}" for x in matrix.ravel())
    return [
        f"   {key}: !!opencv-matrix", f"      rows: {rows}", f"      cols: {columns}",
        "      dt: d", f"      data: [ {numbers} ]",
    ]  # fmt: skip
