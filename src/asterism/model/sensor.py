"""Sensor model: measurement noise, missed detections and clutter."""

from __future__ import annotations

from asterism.checks import check_number
from asterism.records import record

__all__ = ["Sensor"]


@record
class Sensor:
    """Measurement noise, missed detections and clutter of the capture system.

    Parameters
    ----------
    noise_sigma : float
        σ, standard deviation of a measured coordinate, metres, > 0.
    p_detection : float
        P_d, probability that a marker is detected in a frame. With `p_redetection` it holds for
        markers that were detected in the frame before.
    clutter_density : float
        λ_f, false alarms per volume (m³; m² in 2-D) and frame, > 0. Larger values explain more
        detections as clutter.
    p_redetection : float, optional
        P_r, probability that a marker is detected that was missed in the frame before. By default
        it is P_d, so missed detections are independent. Occluded markers are missed in bursts with
        a mean length of 1 / P_r frames (Gilbert 1960, *Capacity of a burst-noise channel*).

    Examples
    --------
    >>> import asterism as am
    >>> sensor = am.Sensor(noise_sigma=3e-4, p_detection=0.95, clutter_density=0.1)
    >>> sensor.p_after_miss
    0.95
    """

    noise_sigma: float
    p_detection: float
    clutter_density: float
    p_redetection: float | None = None

    def __post_init__(self) -> None:
        if self.p_redetection is not None:
            check_number("p_redetection", self.p_redetection, above=0, below=1)
        # One picometre. The square of a much smaller σ would underflow in the filter.
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
        """P_r: `p_redetection`, or P_d if missed detections are independent."""
        return self.p_detection if self.p_redetection is None else self.p_redetection
