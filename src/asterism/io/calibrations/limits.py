"""What the formats can hold: a camera goes into a file as it is, or not at all."""

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
    """Return the cameras' names, and ``camera1``, ``camera2`` … to those without one."""
    names = [camera.name for camera in rig]
    given = [name or f"camera{i + 1}" for i, name in enumerate(names)]
    for i, name in enumerate(given):
        if name in given[:i]:
            raise ParameterError(f"camera {i}", "a name of its own", repr(name))
    return given


def refuse_lens(camera: Camera, format: str, wanted: str, got: str, kind: str) -> NoReturn:
    """Raise for a camera whose lens a format cannot hold.

    Parameters
    ----------
    camera : Camera
        The camera.
    format : str
        The format.
    wanted, got : str
        What it can hold and what it was given.
    kind : str
        The class of lens that would fit.
    """
    hint = (
        f"am.camera.fit_lens(camera, am.{kind}) fits one and says how many pixels it is off; "
        "`asterism camera convert` does that for a whole file"
    )
    raise ParameterError(
        f"the lens of camera {camera.name!r}", f"what {format} can hold, {wanted}", got, hint
    )


def no_skew(camera: Camera, format: str) -> None:
    """Raise if the image axes are not at right angles, for a format that has no number for it."""
    if camera.K[0, 1] != 0:
        raise ParameterError(
            f"K of camera {camera.name!r}", f"no skew, for which {format} has no place",
            f"{camera.K[0, 1]:g}",
        )  # fmt: skip


def brown_coefficients(camera: Camera, format: str) -> NDArray[np.float64]:
    """Return the coefficients of a lens in the manner of OpenCV.

    Parameters
    ----------
    camera : Camera
        With a `BrownConrady` lens that works in the coordinates of K, or with none.
    format : str
        For the error.

    Returns
    -------
    ndarray, shape (5,)
        k1, k2, p1, p2, k3.

    Raises
    ------
    ParameterError
        If the lens is another.
    """
    lens, wanted = camera.lens, "BrownConrady about the camera's own principal point"
    if lens is None:
        return np.zeros(5)
    if not isinstance(lens, BrownConrady):
        refuse_lens(camera, format, wanted, type(lens).__name__, "BrownConrady")
    if camera.K_lens is not None and not np.array_equal(camera.K_lens, camera.K):
        refuse_lens(camera, format, wanted, "one with a K_lens of its own", "BrownConrady")
    return np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3], dtype=np.float64)
