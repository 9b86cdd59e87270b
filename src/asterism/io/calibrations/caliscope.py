"""Caliscope's ``camera_array.toml``: a table ``[cameras.N]`` for each camera, in metres.

The entries are those of anipose. Rotations are Rodrigues vectors, in older files 3 × 3 matrices;
both take world coordinates to camera coordinates. A camera has a number and no name, so that camera
N is called ``cam_N``, in `read_observations` too.
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
    """Tell whether the first bytes of a file look like this format."""
    return re.search(rb"(?m)^\s*\[\s*cameras\s*(\.\s*\"?\d+\"?\s*)?\]", head) is not None


def read(path: Path, units: str | None) -> Rig:
    """Read a rig.

    Parameters
    ----------
    path : Path
        The file.
    units : None
        It is in metres.

    Returns
    -------
    Rig
        The cameras that have a pose; the others are named in its warnings.
    """
    del units
    return anipose.read(path, "m")


def write(rig: Rig) -> bytes:
    """Write a rig.

    Parameters
    ----------
    rig : Rig
        With lenses in the manner of OpenCV, and no skew. Where all cameras are called ``cam_N``
        those are their numbers; else they are numbered from 0 and an entry keeps the name.

    Returns
    -------
    bytes
        The content of the file.
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
