"""TOML of anipose and freemocap: OpenCV's camera model, with rotations as Rodrigues vectors.

Caliscope's file has the same entries, and its rotations are vectors or matrices; see `caliscope`.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

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
    whole_size,
)
from asterism.io.calibrations.toml_text import load, table
from asterism.io.units import parse_unit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Rig

__all__ = ["read", "sniff", "write"]


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of an anipose calibration."""
    return all(re.search(rb"\b%b\"?\s*=" % key, head) for key in (b"matrix", b"distortions"))


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of an anipose or freemocap calibration.

    Parameters
    ----------
    path : Path
        TOML file.
    units : str or None
        Unit of length of the file. None takes it from the file's metadata, or else estimates it
        from the distances of the cameras.

    Returns
    -------
    Rig
        Cameras with a pose. Its `warnings` list the cameras that were left out.

    Raises
    ------
    FormatError
        If an entry is missing or malformed, or if a lens is a fisheye or has more than five
        coefficients.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "calibration.toml")
    ...     _ = path.write_bytes(write(am.Rig.ring(2, radius=3, height=2)))
    ...     read(path, None).names
    ('cam1', 'cam2')
    """
    warnings: list[str] = []
    found: list[dict[str, Any]] = []
    content = load(path)
    metadata = content.get("metadata")
    if units is None and isinstance(metadata, dict):
        units = parse_unit(str(metadata.get("units", "")))
    nested = content.pop("cameras", {})  # where caliscope has them, by number
    if isinstance(nested, dict):
        content |= {f"cam_{key}": entry for key, entry in nested.items()}
    for key, entry in content.items():
        if not isinstance(entry, dict) or "matrix" not in entry:
            if key != "metadata":
                warnings.append(f"the entry {key!r} is not a camera and is left out")
        elif all(entry.get(k, "null") == "null" for k in ("rotation", "translation")):
            warnings.append(f"camera {entry.get('name', key)} has no pose and is left out")
        elif entry.get("ignore") is True:
            warnings.append(f"camera {entry.get('name', key)} is marked ignore and is left out")
        else:
            found.append(_camera(path, key, entry, warnings))
    scale = 1.0
    if found:
        scale = per_metre(units, [-f["R"].T @ f["t"] for f in found], warnings)
    cameras = [
        build_camera(
            path, f["place"], K=f["K"], T_camera_world=pose(f["R"], f["t"] / scale),
            size_px=f["size"], name=f["name"], lens=f["lens"],
        )
        for f in found
    ]  # fmt: skip
    return build_rig(path, cameras, warnings)


def _camera(path: Path, key: str, entry: dict[str, Any], warnings: list[str]) -> dict[str, Any]:
    name = str(entry.get("name", key))
    place = f"camera {name}"
    if entry.get("fisheye"):
        raise FormatError(
            path, f"{place}, fisheye", "false", "true", "fisheye lenses are not modelled"
        )
    size = as_array(path, f"{place}, size", entry.get("size"), (2,))
    distortions = as_array(path, f"{place}, distortions", _flat(entry.get("distortions", [])))
    if len(distortions) > 5 and distortions[5:].any():
        expected = "k1, k2, p1, p2, k3, and nothing after them"
        raise FormatError(path, f"{place}, distortions", expected, f"{len(distortions)} numbers")
    k = np.zeros(5)
    k[: len(distortions[:5])] = distortions[:5]
    K = as_array(path, f"{place}, matrix", entry["matrix"], (3, 3))
    return {
        "place": place,
        "name": name,
        "size": whole_size(path, f"{place}, size", size[0], size[1]),
        "K": drop_skew(place, K, warnings),
        "lens": BrownConrady(*k.tolist()) if k.any() else None,
        "R": _rotation(path, f"{place}, rotation", entry.get("rotation")),
        "t": as_array(path, f"{place}, translation", _flat(entry.get("translation")), (3,)),
    }


def _flat(value: Any) -> Any:
    """Return a row or a column, as some versions of caliscope nest them, as a plain list."""
    if not isinstance(value, list):
        return value
    if len(value) == 1 and isinstance(value[0], list):
        return value[0]
    is_column = all(isinstance(row, list) and len(row) == 1 for row in value)
    return [row[0] for row in value] if is_column else value


def _rotation(path: Path, place: str, value: Any) -> NDArray[np.float64]:
    """Read a rotation, a Rodrigues vector or a matrix."""
    from scipy.spatial.transform import Rotation

    value = _flat(value)
    if isinstance(value, list) and any(isinstance(row, list) for row in value):
        return nearest_rotation(path, place, as_array(path, place, value, (3, 3)))
    return Rotation.from_rotvec(as_array(path, place, value, (3,))).as_matrix()


def write(rig: Rig) -> bytes:
    """Encode a rig as an anipose calibration in metres.

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
    >>> write(am.Rig.ring(1, radius=3, height=2)).decode().splitlines()[:2]
    ['[cam_0]', 'name = "cam1"']
    """
    from scipy.spatial.transform import Rotation

    text = ""
    for i, (camera, name) in enumerate(zip(rig, names_of(rig), strict=True)):
        no_skew(camera, "anipose")
        values = {
            "name": name,
            "size": [int(n) for n in camera.size_px],
            "matrix": camera.K,
            "distortions": brown_coefficients(camera, "anipose"),
            "rotation": Rotation.from_matrix(camera.T_camera_world[:3, :3]).as_rotvec(),
            "translation": camera.T_camera_world[:3, 3],
            "fisheye": False,
        }
        text += table(f"[cam_{i}]", values)
    return (text + table("[metadata]", {"units": "metres"})).encode()
