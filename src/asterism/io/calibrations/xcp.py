"""Vicon calibrations: the XML in ``.xcp``.

Lengths are millimetres, the orientation a quaternion (x, y, z, w) from world to camera. The lens
takes measured pixels to ideal ones by a radial factor in pixels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from asterism.camera import ViconRadial
from asterism.errors import FormatError
from asterism.io.calibrations.limits import names_of, no_skew, refuse_lens
from asterism.io.calibrations.parts import build_camera, build_rig, pose, split_numbers, whole_size
from asterism.io.units import from_metres
from asterism.io.xml_tree import load, to_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig

__all__ = ["read", "sniff", "write"]

_THREE = "Vicon3Parameter"


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a Vicon calibration."""
    return b"<Cameras" in head


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of a Vicon calibration.

    Parameters
    ----------
    path : Path
        XML file, as a rule ``.xcp``.
    units : str or None
        Not used: the format is in millimetres by definition.

    Returns
    -------
    Rig
        Calibrated cameras. A camera without a name has its device number instead. The `warnings`
        list cameras without a key frame, which are left out.

    Raises
    ------
    FormatError
        If an attribute is missing or malformed.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "walk.xcp")
    ...     _ = path.write_bytes(write(am.Rig.ring(2, radius=3, height=2)))
    ...     read(path, None).names
    ('cam1', 'cam2')
    """
    del units
    cameras: list[Camera] = []
    warnings: list[str] = []
    for i, element in enumerate(load(path, "Cameras").iterfind("Camera")):
        name = element.get("NAME", "").strip() or element.get("DEVICEID", "").strip()
        place = f"camera {name or i + 1}"
        frames = element.findall("KeyFrames/KeyFrame")
        if not frames:
            warnings.append(f"{place} has no key frame: it is not calibrated and is left out")
            continue
        first = next((f for f in frames if f.get("FRAME") == "0"), frames[0])
        if len(frames) > 1:
            got = first.get("FRAME", "")
            warnings.append(f"{place} has {len(frames)} key frames, of which that of frame "
                            f"{got!r} is read")  # fmt: skip
        if first.get("PIXEL_ASPECT_RATIO_CORRECTION", "1").strip() not in ("1", "1.0"):
            warnings.append(f"{place}: PIXEL_ASPECT_RATIO_CORRECTION is not applied")
        cameras.append(_camera(path, place, name, element, first))
    return build_rig(path, cameras, warnings)


def _camera(path: Path, place: str, name: str, element: Element, frame: Element) -> Camera:
    from scipy.spatial.transform import Rotation

    def numbers(source: Element, key: str, count: int, otherwise: str | None = None) -> list[float]:
        return split_numbers(path, f"{place}, {key}", source.get(key, otherwise), count)

    size = numbers(element, "SENSOR_SIZE", 2)
    (aspect,) = numbers(element, "PIXEL_ASPECT_RATIO", 1, "1")
    if aspect <= 0:
        raise FormatError(path, f"{place}, PIXEL_ASPECT_RATIO", "a number > 0", f"{aspect:g}")
    (focal,) = numbers(frame, "FOCAL_LENGTH", 1)
    K = np.array([[focal, 0, 0], [0, focal / aspect, 0], [0, 0, 1]])
    K[:2, 2] = numbers(frame, "PRINCIPAL_POINT", 2)
    quaternion = np.array(numbers(frame, "ORIENTATION", 4))
    norm = float(np.linalg.norm(quaternion))
    if not abs(norm - 1) < 1e-3:
        raise FormatError(path, f"{place}, ORIENTATION", "a quaternion of length 1", f"{norm:.3g}")
    R = Rotation.from_quat(quaternion).as_matrix()
    center = np.array(numbers(frame, "POSITION", 3)) / 1000
    lens, K_lens = _lens(path, place, frame)
    return build_camera(
        path, place, K=K, T_camera_world=pose(R, -R @ center), name=name, lens=lens, K_lens=K_lens,
        size_px=whole_size(path, f"{place}, SENSOR_SIZE", *size),
    )  # fmt: skip


def _lens(
    path: Path, place: str, frame: Element
) -> tuple[ViconRadial | None, NDArray[np.float64] | None]:
    text = frame.get("VICON_RADIAL2", "").strip()
    if text:
        model, _, rest = text.partition(" ")
        if model != _THREE:
            raise FormatError(path, f"{place}, VICON_RADIAL2", f"{_THREE!r}", repr(model[:60]))
        *center, k1, k2, k3 = split_numbers(path, f"{place}, VICON_RADIAL2", rest, 5)
        if k1 == k2 == k3 == 0:
            return None, None
        K_lens = np.eye(3)
        K_lens[:2, 2] = center
        return ViconRadial(k1=k1, k2=k2, k3=k3), K_lens
    k1, k2 = split_numbers(path, f"{place}, VICON_RADIAL", frame.get("VICON_RADIAL", "0 0"), 2)
    return (ViconRadial(k1=k1, k2=k2), None) if k1 or k2 else (None, None)


def write(rig: Rig) -> bytes:
    """Encode a rig as a Vicon calibration in millimetres.

    Parameters
    ----------
    rig : Rig
        Cameras without skew, and without a lens or with a `ViconRadial` lens in pixels.

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
    '<Cameras VERSION="1.0">'
    """
    from scipy.spatial.transform import Rotation

    root = Element("Cameras", {"VERSION": "1.0"})
    for i, (camera, name) in enumerate(zip(rig, names_of(rig), strict=True)):
        no_skew(camera, "xcp")
        K = camera.K
        # A name of digits is a device number; any other name is written as a name.
        by_number = name.isascii() and name.isdigit()
        element = SubElement(root, "Camera", {
            "DEVICEID": name if by_number else str(i + 1), "NAME": "" if by_number else name,
            "USERID": str(i + 1), "PIXEL_ASPECT_RATIO": repr(float(K[0, 0] / K[1, 1])),
            "SENSOR_SIZE": " ".join(map(str, camera.size_px)),
        })  # fmt: skip
        quaternion = Rotation.from_matrix(camera.T_camera_world[:3, :3]).as_quat()
        position = from_metres(np.array(camera.center, dtype=np.float64), "mm")
        frame = {
            "FRAME": "0", "FOCAL_LENGTH": repr(float(K[0, 0])), "PRINCIPAL_POINT": _text(K[:2, 2]),
            "ORIENTATION": _text(quaternion), "POSITION": _text(position),
            **_radial(camera),
        }  # fmt: skip
        SubElement(SubElement(element, "KeyFrames"), "KeyFrame", frame)
    return to_bytes(root)


def _radial(camera: Camera) -> dict[str, str]:
    lens, wanted = camera.lens, "ViconRadial in pixels"
    if lens is None:
        return {"VICON_RADIAL": "0 0"}
    if not isinstance(lens, ViconRadial):
        refuse_lens(camera, "xcp", wanted, type(lens).__name__, "ViconRadial")
    center = camera.K[:2, 2] if camera.K_lens is None else camera.K_lens[:2, 2]
    if camera.K_lens is not None and not np.array_equal(camera.K_lens[:2, :2], np.eye(2)):
        refuse_lens(camera, "xcp", wanted, "one whose K_lens has another scale", "ViconRadial")
    if lens.k3 == 0 and np.array_equal(center, camera.K[:2, 2]):
        return {"VICON_RADIAL": _text([lens.k1, lens.k2])}
    return {"VICON_RADIAL2": f"{_THREE} {_text([*center, lens.k1, lens.k2, lens.k3])}"}


def _text(numbers: NDArray[np.float64] | list[float]) -> str:
    return " ".join(repr(float(x)) for x in numbers)
