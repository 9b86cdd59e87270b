"""Check for 3-D points at one fixed rate, which most formats require."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model import Capture

if TYPE_CHECKING:
    from asterism.model import Detections

__all__ = ["fixed_rate"]


def fixed_rate(detections: Detections, format_name: str) -> float:
    """Return the rate of detections that fit a format of 3-D points at a fixed rate.

    Parameters
    ----------
    detections : Detections
        T frames.
    format_name : str
        Name of the format for the message.

    Returns
    -------
    float
        Frame rate in Hz. The stated rate of a `Capture` if every time agrees with it to half a
        frame, because files round their times; else the mean rate; 100 for fewer than two frames.

    Raises
    ------
    ParameterError
        If the points are 2-D, or a spacing is more than 1 % from the mean.
    """
    if detections.n_axes != 3:
        hint = "write CSV, which takes 2-D points"
        raise ParameterError(
            "tracks", f"3-D points, because {format_name} holds no others", "2-D", hint
        )
    times = detections.times
    elapsed = times - times[:1]
    if isinstance(detections, Capture) and detections.rate > 0:
        off = np.abs(elapsed * detections.rate - np.arange(len(times)))
        if off.max(initial=0) < 0.5:
            return detections.rate
    if len(times) < 2:
        return 100.0
    mean = elapsed[-1] / (len(times) - 1)
    spacing = np.diff(times)
    worst = int(np.argmax(np.abs(spacing - mean)))
    if abs(spacing[worst] - mean) > 0.01 * mean:
        raise ParameterError(
            "times", f"evenly spaced frames, because {format_name} has one fixed rate",
            f"{spacing[worst]:g} s after frame {worst}, where the mean is {mean:g} s",
            "write CSV, which keeps the times, or resample first",
        )  # fmt: skip
    return round(float(1 / mean), 6)
