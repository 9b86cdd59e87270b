"""The axis of a capture that points up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from asterism.model.capture import Capture

if TYPE_CHECKING:
    from asterism.model.detections import Detections

__all__ = ["Axis", "up_axis"]

Axis = Literal["x", "y", "z"]

_Y_UP = ("motive", "trc")
"""Formats whose files have the y axis up."""
_BY_THE_GROUND, _OFF_THE_GROUND = 0.1, 0.3  # metres
_FRAMES = 500


def up_axis(detections: Detections) -> tuple[Axis, str]:
    """Return the axis that points up, and a sentence with the reason.

    Parameters
    ----------
    detections : Detections
        Points; the format of a `Capture` is used.

    Examples
    --------
    >>> import asterism as am
    >>> up_axis(am.simulate.person(frames=20, seed=1).detections)[0]
    'z'
    """
    d = detections
    if isinstance(d, Capture) and d.format in _Y_UP:
        return "y", "The y axis points up, as in most files of this format."
    if d.n_axes == 3 and _stands_on_y(d):
        text = "The y axis is taken to point up: the lowest points stay near y = 0, far from z = 0."
        return "y", f"{text} Change it below the player if this is wrong."
    return "z", "The z axis is taken to point up. Change it below the player if this is wrong."


def _stands_on_y(d: Detections) -> bool:
    """Return whether the lowest points stay near the ground y = 0, and far from z = 0."""
    frames = range(0, d.n_frames, max(1, d.n_frames // _FRAMES))
    lowest = [d.frame(t).min(axis=0) for t in frames if len(d.frame(t))]
    if not lowest:
        return False
    _, y, z = np.abs(np.median(lowest, axis=0))
    return bool(y < _BY_THE_GROUND and z > _OFF_THE_GROUND)
