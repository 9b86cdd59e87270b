"""Cameras fitted to what a format can hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.camera import BrownConrady, QuadraticCorrection, Rig, ViconRadial, fit_lens
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from asterism.camera import Camera, Lens, LensFit
    from asterism.io.calibrations.formats import CalibrationFormat

__all__ = ["fit_kind", "fit_to_format"]

_KINDS: dict[str, type[Lens]] = {
    "BrownConrady": BrownConrady,
    "ViconRadial": ViconRadial,
    "QuadraticCorrection": QuadraticCorrection,
}


def fit_to_format(camera: Camera, format: CalibrationFormat) -> LensFit | None:
    """Return a camera the lens, and if need be the K, that a format can hold.

    Parameters
    ----------
    camera : Camera
        The camera.
    format : CalibrationFormat
        Where it is to go.

    Returns
    -------
    LensFit or None
        The new camera and its distance from this one; None if this one fits as it is.
    """
    try:
        format.write(Rig((camera.replace(name="camera"),)))
    except ParameterError:
        return fit_kind(camera, None if camera.lens is None else _KINDS[format.lens], format)
    return None


def fit_kind(camera: Camera, kind: type[Lens] | None, format: CalibrationFormat) -> LensFit:
    """Return a camera another kind of lens, and no coefficient for which a format has no place.

    Where the lens has coordinates of its own (``K_lens``), or K a skew that must go, K and the
    direction of sight are fitted as well. The place of the camera never changes.

    Parameters
    ----------
    camera : Camera
        The camera.
    kind : type of Lens or None
        The lens it shall have.
    format : CalibrationFormat
        Where it is to go.

    Returns
    -------
    LensFit
        The new camera and its distance from this one.
    """
    without = [n for n, has in (("skew", format.has_skew), ("k3", format.has_k3)) if not has]
    drops_skew = not format.has_skew and camera.K[0, 1] != 0
    return fit_lens(
        camera, kind, refit_camera=camera.K_lens is not None or drops_skew, without=without
    )
