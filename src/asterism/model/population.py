"""How markers come and go, and the hard bounds on what may be one track."""

from __future__ import annotations

from typing import Literal

from asterism.checks import check_fields, check_number
from asterism.records import record

__all__ = ["Population"]


@record
class Population:
    """The population side of the generative model.

    Parameters
    ----------
    birth_density : float
        λ_b, new markers per volume (m³; m² in 2-D) and frame.
    p_disappear : float
        p_z, probability that a marker disappears for good from one frame to the next.
    max_speed : float
        v̄, m/s: no link of a track is faster (a margin for the noise is added).
    max_gap : int
        d̄: two consecutive detections of a track are at most so many frames apart, so that up to
        ``max_gap - 1`` misses in a row are bridged.
    termination : {"marginal", "last"}
        How the end of a track is scored: summed over the frames in which it may have died, or as
        in the report, dead right after its last detection.
    """

    birth_density: float
    p_disappear: float
    max_speed: float
    max_gap: int
    termination: Literal["marginal", "last"] = "marginal"

    def __post_init__(self) -> None:
        check_number("birth_density", self.birth_density, above=0)
        check_number("p_disappear", self.p_disappear, above=0, below=1)
        check_number("max_speed", self.max_speed, above=0, below=1e12)
        check_number("max_gap", self.max_gap, above=1, below=1e6, closed=True, integer=True)
        object.__setattr__(self, "max_gap", int(self.max_gap))
        check_fields("termination", [self.termination], ("marginal", "last"))
