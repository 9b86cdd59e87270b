"""Caliscope's ``camera_array.toml``: a table ``[cameras.N]`` for each camera, in metres.

The entries are those of anipose. Rotations are Rodrigues vectors, in older files 3 × 3 matrices;
both take world coordinates to camera coordinates. Cameras have numbers instead of names: camera N
is called ``cam_N``, as in `read_observations`.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from asterism.io.calibrations import anipose
from asterism.io.calibrations.limits import brown_coefficients, names_of, no_skew
from asterism.io.calibrations.toml_text import table

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.camera import Rig

__all__ = ["read", "sniff", "write"]


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a caliscope calibration."""
    return re.search(rb"(?m)^\s*\[\s*cameras\s*(\.\s*\"?\d+\"?\s*)?\]", head) is not None


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of a caliscope calibration.

    Parameters
    ----------
    path : Path
        File ``camera_array.toml``.
    units : str or None
        Not used: the format is in metres by definition.

    Returns
    -------
    Rig
        Cameras with a pose. Its `warnings` list the others.

    Raises
    ------
    FormatError
        If an entry is missing or malformed, or if a lens is a fisheye.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "camera_array.toml")
    ...     _ = path.write_bytes(write(am.Rig.ring(2, radius=3, height=2)))
    ...     read(path, None).names
    ('cam1', 'cam2')
    """
    del units
    return anipose.read(path, "m")


def write(rig: Rig) -> bytes:
    """Encode a rig as a caliscope calibration in metres.

    Parameters
    ----------
    rig : Rig
        Cameras without skew, and without a lens or with a `BrownConrady` lens in the coordinates
        of K. If all names have the form ``cam_N``, the cameras get these numbers. Otherwise they
        are numbered from 0, and an additional entry keeps each name.

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
    ['[cameras.0]', 'cam_id = 0']
    """
    from scipy.spatial.transform import Rotation

    names = names_of(rig)
    matches = [re.fullmatch(r"cam_(0|[1-9]\d{0,5})", name) for name in names]
    numbers = [int(match[1]) if match and all(matches) else i for i, match in enumerate(matches)]
    text = ""
    for camera, name, number in zip(rig, names, numbers, strict=True):
        no_skew(camera, "caliscope")
        values = {
            "cam_id": number,
            "size": [int(n) for n in camera.size_px],
            "rotation_count": 0,
            "matrix": camera.K,
            "distortions": brown_coefficients(camera, "caliscope"),
            "translation": camera.T_camera_world[:3, 3],
            "rotation": Rotation.from_matrix(camera.T_camera_world[:3, :3]).as_rotvec(),
            "fisheye": False,
        }
        own = {} if name == f"cam_{number}" else {"name": name}
        text += table(f"[cameras.{number}]", values | own)
    return text.encode()
