"""What the system sees of a marker: noise, misses and clutter."""

from __future__ import annotations

from asterism.checks import check_number
from asterism.records import record

__all__ = ["Sensor"]


@record
class Sensor:
    """The measurement side of the generative model.

    Parameters
    ----------
    noise_sigma : float
        σ, standard deviation of a measured coordinate, metres.
    p_detection : float
        P_d, probability that a marker is seen in a frame; with `p_redetection`, that of one that
        was seen in the frame before.
    clutter_density : float
        λ_f, false detections per volume (m³; m² in 2-D) and frame.
    p_redetection : float, optional
        P_r, probability that a marker is seen that was missed in the frame before. Without it, it
        is P_d: misses are independent. Markers that hide behind limbs are missed in runs, 1 / P_r
        frames long in the mean (Gilbert 1960, *Capacity of a burst-noise channel*).
    """

    noise_sigma: float
    p_detection: float
    clutter_density: float
    p_redetection: float | None = None

    def __post_init__(self) -> None:
        if self.p_redetection is not None:
            check_number("p_redetection", self.p_redetection, above=0, below=1)
        # A picometre: far less and its square is no number that a filter can work with.
        check_number("noise_sigma", self.noise_sigma, above=1e-12, below=1e12, closed=True)
        check_number(
            "p_detection",
            self.p_detection,
            above=0,
            below=1,
            hint="0.999 where every marker is always seen: at 1 a single miss would be impossible",
        )
        check_number(
            "clutter_density",
            self.clutter_density,
            above=0,
            hint="a small number where there is no clutter",
        )

    @property
    def p_after_miss(self) -> float:
        """P_r: `p_redetection`, or P_d where misses are independent."""
        return self.p_detection if self.p_redetection is None else self.p_redetection
