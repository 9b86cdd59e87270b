"""Preset rigs: cameras in a ring or along a wall that see the whole of a scene."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["is_preset", "place_preset"]

SIZE_PX, FOCAL_PX = (1280, 1024), 900.0
_MARGIN = 1.15  # margin about the scene, also for inexact cameras
_ELEVATION = math.radians(25)  # of a ring's cameras above the middle of the scene
_MIN_RADIUS = 0.1  # metres, also for a scene of a single point


def is_preset(text: str) -> bool:
    """Return whether a text is the name of a preset: ``ring`` or ``wall`` and a number.

    Parameters
    ----------
    text : str
        Text to test.

    Returns
    -------
    bool
    """
    return re.fullmatch(r"(ring|wall)\d+", text) is not None


def place_preset(text: str, low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[Rig, str]:
    """Place the cameras of a preset about a box so that each sees the whole box; z is up.

    A sphere of radius R about the box lies within the narrower angle of an image, 2 α, from the
    distance R / sin α on.

    Parameters
    ----------
    text : str
        Name of the preset: ``ring8``, ``wall4`` and so on.
    low, high : ndarray of shape (3,)
        Corners of the box, metres.

    Returns
    -------
    rig : Rig
    about : str
        Description of the rig in one line.

    Raises
    ------
    ParameterError
        If there are no cameras, or too many.
    """
    shape, n = text[:4], int(text[4:])
    check_number("--rig (cameras)", n, above=1, below=1000, closed=True, integer=True)
    middle = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, _MIN_RADIUS)
    half_angle = math.atan(min(SIZE_PX) / 2 / FOCAL_PX)
    # Rounded up to a centimetre, so that the description is exact.
    distance = math.ceil(100 * _MARGIN * radius / math.sin(half_angle)) / 100
    place = Rig.ring if shape == "ring" else Rig.wall
    if shape == "ring":
        height = round(float(middle[2]) + distance * math.tan(_ELEVATION), 2)
        sizes = {"radius": distance, "height": height}
        where = f"in a ring of radius {distance:g} m"
    else:
        height = round(float(middle[2]) + distance / 4, 2)
        sizes = {"width": distance, "distance": distance, "height": height}
        where = f"along {distance:g} m at {distance:g} m towards -y"
    rig = place(n, **sizes, target=middle, focal_px=FOCAL_PX, size_px=SIZE_PX)
    at = ", ".join(f"{x + 0.0:.2f}" for x in middle.round(2))
    return rig, f"{n} cameras {where}, z = {height:g} m, looking at ({at}); z is taken as up"
