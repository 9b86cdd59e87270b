"""Checks of a calibration: plausibility of a rig, and reprojection of known points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.multiview.rig_info import image_grid, meeting_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.camera import Camera, Rig
    from asterism.io.calibrations.points import Sightings

__all__ = ["Check", "check_points", "check_rig"]

# Results of a check; the last one ends the command with exit code 1.
PASSES, IS_ODD, FAILS = "passes", "is odd", "fails"


@dataclass(frozen=True, kw_only=True)
class Check:
    """Result of a check.

    Parameters
    ----------
    name : str
        Property that was checked.
    status : {"passes", "is odd", "fails"}
        "is odd" marks an unusual but possible value, "fails" an impossible one.
    detail : str
        Measured values, with the names of the cameras concerned.
    """

    name: str
    status: str
    detail: str


def check_rig(rig: Rig) -> list[Check]:
    """Check a rig for implausible values.

    Parameters
    ----------
    rig : Rig
        Cameras to check.

    Returns
    -------
    list of Check
        One for each property, in a fixed order.
    """
    return [
        _worst(rig, "rotations", _rotation, "R Rᵀ off by at most {}", (1e-9, 1e-6)),
        _worst(rig, "focal lengths along u and v", _focal, "differ by at most {} %", (5.0, 25.0)),
        _worst(rig, "principal points", _principal, "at most {} % of the image off", (25.0, 50.0)),
        _worst(rig, "lenses reach the image", _unreached, "at most {} % of it is not", (0.0, 5.0)),
        _worst(rig, "pixel to ray and back", _round_trip, "off by at most {} px", (1e-9, 1e-6)),
        _apart(rig),
        _common(rig),
    ]  # fmt: skip


def _worst(rig: Rig, name: str, figure: Any, text: str, limits: tuple[float, float]) -> Check:
    """Rate each camera by a value with a limit for a warning and a limit for an error."""
    values = [float(figure(camera)) for camera in rig]
    status = PASSES
    for limit, worse in zip(limits, (IS_ODD, FAILS), strict=True):
        if any(not value <= limit for value in values):
            status = worse
    top = int(np.argmax(np.nan_to_num(values, nan=np.inf)))
    limit = limits[0] if status != FAILS else limits[1]
    which = [n for n, value in zip(rig.names, values, strict=True) if not value <= limit]
    detail = text.format(f"{values[top]:.3g}")
    return Check(
        name=name, status=status, detail=f"{detail}: {', '.join(which)}" if which else detail
    )


def _rotation(camera: Camera) -> float:
    R = camera.T_camera_world[:3, :3]
    return float(np.abs(R @ R.T - np.eye(3)).max())


def _focal(camera: Camera) -> float:
    return 100 * abs(float(np.log(camera.K[0, 0] / camera.K[1, 1])))


def _principal(camera: Camera) -> float:
    size = np.array(camera.size_px)
    return float(100 * (np.abs(camera.K[:2, 2] - (size - 1) / 2) / size).max())


def _unreached(camera: Camera) -> float:
    return float(100 * np.isnan(camera.undistort(image_grid(camera))).any(axis=1).mean())


def _round_trip(camera: Camera) -> float:
    pixels = image_grid(camera)
    rays = camera.rays(pixels)
    is_reached = np.isfinite(rays).all(axis=1)
    if not is_reached.any():
        return float("nan")
    depth = (
        np.maximum(2.0, camera.near * 1.5)
        if np.isinf(camera.far)
        else (camera.near + camera.far) / 2
    )
    seen = camera.project(camera.center + depth * rays[is_reached]).pixels
    return float(np.abs(seen - pixels[is_reached]).max())


def _apart(rig: Rig) -> Check:
    name = "places of the cameras"
    if len(rig) < 2:
        return Check(
            name=name, status=IS_ODD, detail="one camera only: nothing can be triangulated"
        )
    centers = np.array([camera.center for camera in rig])
    between = np.linalg.norm(centers[:, np.newaxis] - centers, axis=-1)
    between[np.diag_indices(len(rig))] = np.inf
    i, j = (int(n) for n in np.unravel_index(np.argmin(between), between.shape))
    detail = f"{rig.names[i]} and {rig.names[j]} are nearest, {between[i, j]:.3g} m"
    return Check(name=name, status=PASSES if between[i, j] > 1e-3 else FAILS, detail=detail)


def _common(rig: Rig) -> Check:
    name = "a common volume"
    meeting = meeting_point(rig)
    if meeting is None:
        return Check(name=name, status=IS_ODD, detail="all cameras look along one direction")
    seen = rig.project(meeting).visible
    where = ", ".join(f"{x:.3f}" for x in meeting)
    detail = f"{int(seen.sum())} of {len(rig)} cameras see where their axes meet, at ({where}) m"
    blind = [n for n, sees in zip(rig.names, seen, strict=True) if not sees]
    if blind:
        detail += f"; not {', '.join(blind)}"
    status = FAILS if seen.sum() < 2 else IS_ODD if 2 * seen.sum() < len(rig) else PASSES
    return Check(name=name, status=status, detail=detail)


def check_points(
    rig: Rig, sightings: Sequence[Sightings], most: float
) -> tuple[list[Check], list[dict[str, Any]]]:
    """Check a rig by the reprojection errors of known points.

    Parameters
    ----------
    rig : Rig
        Cameras to check.
    sightings : sequence of Sightings
        Known points with their measured pixels, by camera.
    most : float
        Largest median error that passes, pixels.

    Returns
    -------
    checks : list of Check
        One over all cameras.
    errors : list of dict
        For each camera its name, the number of points, the number of points that it cannot see, and
        the median, 95th percentile and maximum of the error in pixels.
    """
    errors: list[dict[str, Any]] = []
    for name in rig.names:
        parts = [s for s in sightings if s.camera == name]
        if not parts:
            continue
        points = np.concatenate([s.points for s in parts])
        pixels = np.concatenate([s.pixels for s in parts])
        away = np.linalg.norm(rig[name].project(points).pixels - pixels, axis=1)
        seen = away[np.isfinite(away)]
        middle, high, worst = np.percentile(seen, [50, 95, 100]) if len(seen) else [np.nan] * 3
        errors.append({
            "camera": name, "n_points": len(points), "n_unseen": len(away) - len(seen),
            "median_px": float(middle), "percentile_95_px": float(high), "worst_px": float(worst),
        })  # fmt: skip
    bad = [e["camera"] for e in errors
           if not e["median_px"] <= most or 2 * e["n_unseen"] > e["n_points"]]  # fmt: skip
    top = max(errors, key=lambda e: np.nan_to_num(e["median_px"], nan=np.inf))
    detail = f"median {top['median_px']:.3g} px at most ({top['camera']}), where {most:g} may be"
    if bad:
        detail += f"; not {', '.join(bad)}"
    check = Check(name="known points", status=FAILS if bad else PASSES, detail=detail)
    return [check], errors
