"""Limits of the calibration formats: a camera is written exactly, or refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import numpy as np

from asterism.camera import BrownConrady
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Camera, Rig

__all__ = ["brown_coefficients", "names_of", "no_skew", "refuse_lens"]


def names_of(rig: Rig) -> list[str]:
    """Return the names of the cameras; camera N without a name is called ``cameraN``."""
    names = [camera.name for camera in rig]
    given = [name or f"camera{i + 1}" for i, name in enumerate(names)]
    for i, name in enumerate(given):
        if name in given[:i]:
            raise ParameterError(f"camera {i}", "a unique name", repr(name))
    return given


def refuse_lens(camera: Camera, format: str, wanted: str, got: str, kind: str) -> NoReturn:
    """Raise for a camera whose lens a format cannot hold.

    Parameters
    ----------
    camera : Camera
        Camera with the lens.
    format : str
        Name of the format.
    wanted, got : str
        Lens that the format can hold, and lens of the camera.
    kind : str
        Class of lens that the format can hold.
    """
    hint = (
        f"am.camera.fit_lens(camera, am.{kind}) fits one and returns its error in pixels; "
        "`asterism camera convert` converts a whole file"
    )
    raise ParameterError(
        f"the lens of camera {camera.name!r}", f"{wanted}, which {format} can hold", got, hint
    )


def no_skew(camera: Camera, format: str) -> None:
    """Raise if the image axes of a camera are not at right angles."""
    if camera.K[0, 1] != 0:
        raise ParameterError(
            f"K of camera {camera.name!r}", f"no skew, because {format} cannot hold it",
            f"{camera.K[0, 1]:g}",
        )  # fmt: skip


def brown_coefficients(camera: Camera, format: str) -> NDArray[np.float64]:
    """Return the coefficients of a camera's `BrownConrady` lens.

    Parameters
    ----------
    camera : Camera
        Camera without a lens, or with a `BrownConrady` lens in the coordinates of K.
    format : str
        Name of the format for the error.

    Returns
    -------
    ndarray of shape (5,)
        k1, k2, p1, p2, k3; zeros without a lens.

    Raises
    ------
    ParameterError
        If the camera has another lens.
    """
    lens, wanted = camera.lens, "BrownConrady about the camera's own principal point"
    if lens is None:
        return np.zeros(5)
    if not isinstance(lens, BrownConrady):
        refuse_lens(camera, format, wanted, type(lens).__name__, "BrownConrady")
    if camera.K_lens is not None and not np.array_equal(camera.K_lens, camera.K):
        refuse_lens(camera, format, wanted, "one with another K_lens", "BrownConrady")
    return np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3], dtype=np.float64)
