"""Population model: births and deaths of markers, and the hard bounds of a track."""

from __future__ import annotations

from typing import Literal

from asterism.checks import check_fields, check_number
from asterism.records import record

__all__ = ["Population"]


@record
class Population:
    """Births and deaths of markers, and the hard bounds on speed and gaps of a track.

    Parameters
    ----------
    birth_density : float
        λ_b, new markers per volume (m³; m² in 2-D) and frame, > 0. Larger values start tracks on
        weaker evidence.
    p_disappear : float
        p_z, probability that a marker disappears permanently from one frame to the next. Larger
        values terminate tracks after fewer missed detections.
    max_speed : float
        v̄, largest speed of a link between two detections of a track, m/s; a margin for the noise
        is added.
    max_gap : int
        d̄, largest number of frames between two consecutive detections of a track, ≥ 1. A track
        survives up to ``max_gap - 1`` missed detections in a row.
    termination : {"marginal", "last"}
        Score of the end of a track. "marginal" sums over all frames in which the marker may have
        disappeared; "last" assumes, as in the 2010 report, the frame after its last detection.

    Examples
    --------
    >>> import asterism as am
    >>> am.Population(birth_density=0.01, p_disappear=1e-3, max_speed=8, max_gap=10).termination
    'marginal'
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
