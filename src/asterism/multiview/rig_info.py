"""Summary of a rig: optics and view of each camera, and distances between cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig

__all__ = ["CameraInfo", "describe_rig", "image_grid", "meeting_point"]

_SIDE = 61  # pixels along each side of the image at which a lens is evaluated


@dataclass(frozen=True, kw_only=True)
class CameraInfo:
    """Summary of a camera: position, field of view and distortion.

    Parameters
    ----------
    name, lens : str
        Name of the camera, and class of its lens, "–" for none.
    size_px, focal_px : tuple
        Width and height; focal lengths along both axes, pixels.
    field_deg : tuple of float
        Angles between the rays of the centres of opposite image edges, degrees; NaN if the lens
        model does not reach them.
    position, looks_at : tuple of float
        Position, and the point of the optical axis nearest to the meeting point of all axes, or
        1 m ahead of a single camera; world metres.
    largest_shift_px : float
        Largest displacement of a pixel by the lens.
    reach_percent : float
        Share of the image that the lens model covers, percent.
    """

    name: str
    size_px: tuple[int, int]
    focal_px: tuple[float, float]
    field_deg: tuple[float, float]
    position: tuple[float, ...]
    looks_at: tuple[float, ...]
    lens: str
    largest_shift_px: float
    reach_percent: float


def describe_rig(rig: Rig) -> tuple[list[CameraInfo], dict[str, Any]]:
    """Summarise each camera and the rig.

    Parameters
    ----------
    rig : Rig
        Cameras to summarise.

    Returns
    -------
    cameras : list of CameraInfo
        In the order of the rig.
    whole : dict
        Number of cameras, meeting point of their axes, largest distance of an axis from it, number
        of cameras that see it, and smallest and largest distance between two cameras; metres.
    """
    meeting = meeting_point(rig)
    cameras = [_describe(c, n, meeting) for c, n in zip(rig, rig.names, strict=True)]
    whole: dict[str, Any] = {"n_cameras": len(rig)}
    if meeting is not None:
        along = [np.asarray(c.looks_at) - meeting for c in cameras]
        centers = np.array([c.center for c in rig])
        between = np.linalg.norm(centers[:, np.newaxis] - centers, axis=-1)
        apart = between[np.triu_indices(len(rig), 1)]
        whole |= {
            "axes_meet_at": tuple(map(float, meeting)),
            "axes_pass_it_by": float(np.linalg.norm(along, axis=1).max()),
            "cameras_that_see_it": int(rig.project(meeting).visible.sum()),
            "least_distance_between_cameras": float(apart.min()),
            "greatest_distance_between_cameras": float(apart.max()),
        }
    return cameras, whole


def meeting_point(rig: Rig) -> NDArray[np.float64] | None:
    """Return the position with the smallest squared distance to all optical axes.

    Parameters
    ----------
    rig : Rig
        Cameras of which at least two are not parallel.

    Returns
    -------
    ndarray of shape (3,), or None
        World metres; None if all axes are parallel, or there is one camera only.
    """
    # The distance is measured across each axis, so the sum of (1 - a aᵀ)(x - c) is zero.
    across = [np.eye(3) - np.outer(c.axis, c.axis) for c in rig]
    normal = np.sum(across, axis=0)
    if len(rig) < 2 or np.linalg.cond(normal) > 1e9:
        return None
    right = np.sum([P @ c.center for P, c in zip(across, rig, strict=True)], axis=0)
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)


def image_grid(camera: Camera) -> NDArray[np.float64]:
    """Return a grid of pixels over an image, including its edges.

    Parameters
    ----------
    camera : Camera
        Camera whose image is covered.

    Returns
    -------
    ndarray of shape (N, 2)
    """
    u, v = (np.linspace(-0.5, n - 0.5, _SIDE) for n in camera.size_px)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def _describe(camera: Camera, name: str, meeting: NDArray[np.float64] | None) -> CameraInfo:
    pixels = image_grid(camera)
    normalised = camera.undistort(pixels)
    is_reached = np.isfinite(normalised).all(axis=1)
    ideal = normalised @ camera.K[:2, :2].T + camera.K[:2, 2]
    shift = np.linalg.norm(ideal - pixels, axis=1)[is_reached] if camera.lens else np.zeros(1)
    width, height = camera.size_px
    middle = (width - 1) / 2, (height - 1) / 2
    left, right, top, bottom = camera.rays(np.array([
        (-0.5, middle[1]), (width - 0.5, middle[1]), (middle[0], -0.5), (middle[0], height - 0.5),
    ]))  # fmt: skip
    ahead = 1.0 if meeting is None else float((meeting - camera.center) @ camera.axis)
    return CameraInfo(
        name=name,
        size_px=camera.size_px,
        focal_px=(float(camera.K[0, 0]), float(camera.K[1, 1])),
        field_deg=(_angle(left, right), _angle(top, bottom)),
        position=tuple(map(float, camera.center)),
        looks_at=tuple(map(float, camera.center + ahead * camera.axis)),
        lens="–" if camera.lens is None else type(camera.lens).__name__,
        largest_shift_px=float(shift.max()) if len(shift) else float("nan"),
        reach_percent=float(100 * is_reached.mean()),
    )


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
