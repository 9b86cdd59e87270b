"""Fitting of cameras to the limits of a calibration format."""

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
    """Fit the lens of a camera, and K if necessary, to the limits of a format.

    Parameters
    ----------
    camera : Camera
        Camera to fit.
    format : CalibrationFormat
        Format that must be able to hold the result.

    Returns
    -------
    LensFit or None
        Fitted camera and its error in pixels; None if the format can hold `camera` itself.
    """
    try:
        format.write(Rig((camera.replace(name="camera"),)))
    except ParameterError:
        return fit_kind(camera, None if camera.lens is None else _KINDS[format.lens], format)
    return None


def fit_kind(camera: Camera, kind: type[Lens] | None, format: CalibrationFormat) -> LensFit:
    """Fit a lens of another class to a camera, without coefficients that a format cannot hold.

    K and the orientation are fitted too if the camera has a ``K_lens``, or a skew that the format
    cannot hold. The position of the camera never changes.

    Parameters
    ----------
    camera : Camera
        Camera to fit.
    kind : type of Lens or None
        Class of the new lens, None for no lens.
    format : CalibrationFormat
        Format that must be able to hold the result.

    Returns
    -------
    LensFit
        Fitted camera and its error in pixels.
    """
    without = [n for n, has in (("skew", format.has_skew), ("k3", format.has_k3)) if not has]
    drops_skew = not format.has_skew and camera.K[0, 1] != 0
    return fit_lens(
        camera, kind, refit_camera=camera.K_lens is not None or drops_skew, without=without
    )
