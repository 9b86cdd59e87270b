"""Image model: noise, missed detections, clutter and density of the points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_array, check_number
from asterism.errors import ParameterError
from asterism.multiview.triangulation import per_camera
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from asterism.camera import Rig

__all__ = ["CameraNumbers", "ImageModel", "widest_base"]

_REACH = 10  # base lines; beyond this distance the depth is not determined

CameraNumbers = float | tuple[float, ...]
"""A number for all cameras, or one for each camera."""


@record
class ImageModel:
    """Image model of a rig: noise, missed detections and clutter of its images.

    Parameters
    ----------
    sigma_px : float or tuple of float
        Standard deviation of an image point, pixels per axis, > 0.
    p_detection : float or tuple of float
        Probability that a camera reports a point inside its image, in (0, 1). Occlusions by bodies
        count as missed detections, so frequent occlusions lower it.
    clutter : float or tuple of float
        Expected number of image points per camera and frame that belong to no point in space, > 0:
        false alarms, and markers that no other camera sees.
    density : float
        Number of points in space per cubic metre of the volume, > 0.
    volume : (low, high), each 3 floats, optional
        Corners of the box that holds all points, world metres. By default the box is centred on
        the cameras and extends on each side by ten times the largest distance between two of them.

    Raises
    ------
    ParameterError
        If a number is out of range. The count of numbers, one for each camera, is checked in use.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=3, height=2)
    >>> model = am.multiview.ImageModel(sigma_px=(0.2, 0.4), volume=((-1, -1, 0), (1, 1, 2)))
    >>> sigma, p_detection, clutter = model.of(rig)
    >>> sigma, p_detection
    (array([0.2, 0.4]), array([0.9, 0.9]))
    >>> model.box(rig)
    ((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))
    """

    sigma_px: CameraNumbers = 0.3
    p_detection: CameraNumbers = 0.9
    clutter: CameraNumbers = 1.0
    density: float = 10.0
    volume: tuple[ArrayLike, ArrayLike] | None = None

    def __post_init__(self) -> None:
        for name in ("sigma_px", "p_detection", "clutter"):
            value = getattr(self, name)
            below = 1.0 if name == "p_detection" else np.inf
            if isinstance(value, (tuple, list, np.ndarray)):
                value = tuple(float(v) for v in value)
                object.__setattr__(self, name, value)
                for i, number in enumerate(value):
                    check_number(f"{name}[{i}]", number, above=0, below=below)
            else:
                check_number(name, value, above=0, below=below)
        check_number("density", self.density, above=0)
        if self.volume is not None:
            if not isinstance(self.volume, (tuple, list)) or len(self.volume) != 2:  # pyright: ignore[reportUnnecessaryIsInstance]
                raise ParameterError("volume", "two corners, low and high", repr(self.volume))
            low, high = (check_array("volume", corner, (3,)).tolist() for corner in self.volume)
            if not np.all(np.less(low, high)):
                raise ParameterError("volume", f"a corner beyond {low} on every axis", high)
            object.__setattr__(self, "volume", (tuple(low), tuple(high)))

    def of(self, rig: Rig) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return noise, detection probability and clutter of each camera.

        Parameters
        ----------
        rig : Rig
            The C cameras.

        Returns
        -------
        sigma, p_detection, clutter : ndarray of shape (C,)
            Pixels; probability; image points per frame and square pixel.

        Raises
        ------
        ParameterError
            If there are numbers for another number of cameras.
        """
        area = np.array([float(np.prod(camera.size_px)) for camera in rig])
        return (
            per_camera("sigma_px", self.sigma_px, rig),
            per_camera("p_detection", self.p_detection, rig, below=1.0),
            per_camera("clutter", self.clutter, rig) / area,
        )

    def box(self, rig: Rig) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the corners of the given or default volume.

        Parameters
        ----------
        rig : Rig
            Cameras that define the default volume.

        Returns
        -------
        low, high : (float, float, float)
            World metres.
        """
        if self.volume is not None:
            low, high = (np.asarray(corner).tolist() for corner in self.volume)
        else:
            centers = np.stack([camera.center for camera in rig])
            middle = centers.mean(axis=0)
            reach = _REACH * widest_base(rig)
            low, high = (middle - reach).tolist(), (middle + reach).tolist()
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def widest_base(rig: Rig) -> float:
    """Return the largest distance between two cameras.

    Parameters
    ----------
    rig : Rig
        Cameras.

    Returns
    -------
    float
        Metres.

    Examples
    --------
    >>> import asterism as am
    >>> round(widest_base(am.Rig.ring(4, radius=3, height=2)), 6)
    6.0
    """
    centers = np.stack([camera.center for camera in rig])
    return float(np.linalg.norm(centers[:, None] - centers, axis=-1).max())
