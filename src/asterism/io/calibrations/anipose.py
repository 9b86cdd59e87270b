"""TOML of anipose and freemocap: OpenCV's camera, the rotation as a Rodrigues vector.

Caliscope's own file has the same entries, its rotations vectors or matrices; see `caliscope`.
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
    """Tell whether the first bytes of a file look like this format."""
    return all(re.search(rb"\b%b\"?\s*=" % key, head) for key in (b"matrix", b"distortions"))


def read(path: Path, units: str | None) -> Rig:
    """Read a rig.

    Parameters
    ----------
    path : Path
        The file.
    units : str or None
        Its unit of length; else what its metadata says, else by the cameras' distances.

    Returns
    -------
    Rig
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
                warnings.append(f"the entry {key!r} is no camera and is left out")
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
    """Write a rig in metres.

    Parameters
    ----------
    rig : Rig
        With lenses in the manner of OpenCV, and no skew.

    Returns
    -------
    bytes
        The content of the file.
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
