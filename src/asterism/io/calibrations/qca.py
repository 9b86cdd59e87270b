"""Qualisys calibrations: the XML in ``.qca.txt``.

Lengths are millimetres; image coordinates are 1/64 pixel of the whole sensor. The matrix takes
world coordinates to camera coordinates with y up and z backwards; a half turn about x converts them
to ours. Distortion is OpenCV's, in dimensionless numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from asterism.camera import BrownConrady
from asterism.errors import FormatError
from asterism.io.calibrations.limits import brown_coefficients, names_of, no_skew
from asterism.io.calibrations.parts import (
    build_camera,
    build_rig,
    nearest_rotation,
    pose,
    split_numbers,
    whole_size,
)
from asterism.io.units import from_metres
from asterism.io.xml_tree import load, to_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.camera import Camera, Rig

__all__ = ["encode", "from_element", "read", "sniff", "write"]

_SUBPIXELS = 64
_HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x; its own inverse
_LENS = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2",
         "radialDistortion3")  # fmt: skip


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a Qualisys calibration."""
    return b"<calibration" in head


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of a Qualisys calibration.

    Parameters
    ----------
    path : Path
        XML file, as a rule ``.qca.txt``.
    units : str or None
        Not used: the format is in millimetres by definition.

    Returns
    -------
    Rig
        Calibrated cameras, named by their serial numbers. Its `warnings` list the others.

    Raises
    ------
    FormatError
        If an attribute is missing or malformed, or if a camera has skew.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "hall.qca.txt")
    ...     _ = path.write_bytes(write(am.Rig.ring(2, radius=3, height=2)))
    ...     read(path, None).names
    ('cam1', 'cam2')
    """
    del units
    return from_element(path, load(path, "calibration"))


def from_element(path: Path, calibration: Element) -> Rig:
    """Return the cameras of a calibration in XML.

    Parameters
    ----------
    path : Path
        File, for errors.
    calibration : Element
        Element ``calibration``, of a file or of the settings of a running system.

    Returns
    -------
    Rig
        As for `read`.

    Raises
    ------
    FormatError
        As for `read`.
    """
    cameras: list[Camera] = []
    warnings: list[str] = []
    for i, element in enumerate(calibration.iterfind("cameras/camera")):
        name = element.get("serial", "")
        place = f"camera {name or i + 1}"
        if element.get("active", "1") == "0" or element.get("calibrated", "true") == "false":
            warnings.append(f"{place} is not calibrated and is left out")
            continue
        cameras.append(_camera(path, place, name, element))
    return build_rig(path, cameras, warnings)


def _camera(path: Path, place: str, name: str, element: Element) -> Camera:
    def number(child: str, key: str, otherwise: str | None = None) -> float:
        found = element.find(child)
        text = otherwise if found is None else found.get(key, otherwise)
        return split_numbers(path, f"{place}, {child} {key}", text, 1)[0]

    # The image is a window of the sensor, and its coordinates begin at the edge of the window.
    window = "fov_video" if "video" in element.get("model", "").lower() else "fov_marker"
    if element.find(window) is None:
        window = {"fov_video": "fov_marker", "fov_marker": "fov_video"}[window]
    left, top, right, bottom = (number(window, k) for k in ("left", "top", "right", "bottom"))
    size = whole_size(path, f"{place}, {window}", right - left + 1, bottom - top + 1)
    if number("intrinsic", "skew", "0") != 0:
        got = f"{number('intrinsic', 'skew'):g}"
        raise FormatError(path, f"{place}, intrinsic skew", "0, as Qualisys writes it", got)
    K = np.eye(3)
    K[0, 0], K[1, 1] = (number("intrinsic", f"focalLength{k}") / _SUBPIXELS for k in "UV")
    K[0, 2] = number("intrinsic", "centerPointU") / _SUBPIXELS - left
    K[1, 2] = number("intrinsic", "centerPointV") / _SUBPIXELS - top
    k = [number("intrinsic", key, "0") for key in _LENS]
    entries = [number("transform", f"r{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)]
    given = np.array(entries).reshape(3, 3)
    R = _HALF_TURN @ nearest_rotation(path, f"{place}, transform", given)
    center = np.array([number("transform", axis) for axis in "xyz"]) / 1000
    return build_camera(
        path, place, K=K, T_camera_world=pose(R, -R @ center), size_px=size, name=name,
        lens=BrownConrady(*k) if any(k) else None,
    )  # fmt: skip


def write(rig: Rig) -> bytes:
    """Encode a rig as a Qualisys calibration in millimetres.

    Parameters
    ----------
    rig : Rig
        Cameras without skew, and without a lens or with a `BrownConrady` lens in the coordinates
        of K. Names are written as serial numbers.

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
    >>> write(am.Rig.ring(1, radius=3, height=2)).decode().splitlines()[1]
    '<calibration type="regular" source="Asterism">'
    """
    return to_bytes(encode(rig))


def encode(rig: Rig) -> Element:
    """Return the XML of a calibration, the element ``calibration``; see `write`.

    Raises
    ------
    ParameterError
        As for `write`.
    """
    root = Element("calibration", {"type": "regular", "source": "Asterism"})
    cameras = SubElement(root, "cameras")
    for camera, name in zip(rig, names_of(rig), strict=True):
        no_skew(camera, "qca")
        width, height = camera.size_px
        element = SubElement(
            cameras, "camera", {"active": "1", "calibrated": "true", "serial": name, "model": "",
                                "viewrotation": "0"},
        )  # fmt: skip
        edges = {"left": 0, "top": 0, "right": width - 1, "bottom": height - 1}
        for window in ("fov_marker", "fov_marker_max", "fov_video", "fov_video_max"):
            SubElement(element, window, {key: str(n) for key, n in edges.items()})
        center = from_metres(np.array(camera.center, dtype=np.float64), "mm")
        M = _HALF_TURN @ camera.T_camera_world[:3, :3]
        transform = {axis: repr(float(x)) for axis, x in zip("xyz", center, strict=True)}
        transform |= {f"r{i + 1}{j + 1}": repr(float(M[i, j])) for i in range(3) for j in range(3)}
        SubElement(element, "transform", transform)
        K = camera.K * _SUBPIXELS
        intrinsic: dict[str, float] = {
            "sensorMinU": 0, "sensorMaxU": width * _SUBPIXELS - 1,
            "sensorMinV": 0, "sensorMaxV": height * _SUBPIXELS - 1,
            "focalLengthU": K[0, 0], "focalLengthV": K[1, 1],
            "centerPointU": K[0, 2], "centerPointV": K[1, 2], "skew": 0,
            **dict(zip(_LENS, brown_coefficients(camera, "qca"), strict=True)),
        }  # fmt: skip
        SubElement(element, "intrinsic", {key: repr(float(x)) for key, x in intrinsic.items()})
    return root
