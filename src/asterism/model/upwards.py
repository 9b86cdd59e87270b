"""The axis of a capture that points up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from asterism.model.capture import Capture

if TYPE_CHECKING:
    from asterism.model.detections import Detections

__all__ = ["Axis", "UpReason", "up_axis"]

Axis = Literal["x", "y", "z"]
UpReason = Literal["format", "ground", "assumed"]
"""Whether the axis follows from the format of the file, from the ground, or from nothing."""

_Y_UP = ("motive", "trc")
"""Formats whose files have the y axis up."""
_BY_THE_GROUND, _OFF_THE_GROUND = 0.1, 0.3  # metres
_FRAMES = 500


def up_axis(detections: Detections) -> tuple[Axis, UpReason]:
    """Return the axis that points up, and the reason.

    Parameters
    ----------
    detections : Detections
        Points; the format of a `Capture` is used.

    Examples
    --------
    >>> import asterism as am
    >>> up_axis(am.simulate.person(frames=20, seed=1).detections)
    ('z', 'assumed')
    """
    d = detections
    if isinstance(d, Capture) and d.format in _Y_UP:
        return "y", "format"
    if d.n_axes == 3 and _stands_on_y(d):
        return "y", "ground"
    return "z", "assumed"


def _stands_on_y(d: Detections) -> bool:
    """Return whether the lowest points stay near the ground y = 0, and far from z = 0."""
    frames = range(0, d.n_frames, max(1, d.n_frames // _FRAMES))
    lowest = [d.frame(t).min(axis=0) for t in frames if len(d.frame(t))]
    if not lowest:
        return False
    _, y, z = np.abs(np.median(lowest, axis=0))
    return bool(y < _BY_THE_GROUND and z > _OFF_THE_GROUND)
