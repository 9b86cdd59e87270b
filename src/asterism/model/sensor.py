"""What the system sees of a marker: noise, misses and clutter."""

from __future__ import annotations

from dataclasses import dataclass

from asterism.errors import check_number

__all__ = ["Sensor"]


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """The measurement side of the generative model.

    Parameters
    ----------
    noise_sigma : float
        σ, standard deviation of a measured coordinate, metres.
    p_detection : float
        P_d, probability that a marker is seen in a frame.
    clutter_density : float
        λ_f, false detections per volume (m³; m² in 2-D) and frame.
    """

    noise_sigma: float
    p_detection: float
    clutter_density: float

    def __post_init__(self) -> None:
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
