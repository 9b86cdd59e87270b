"""Report of an estimated model: each value with its standard deviation and reason."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

from asterism.model import DWNA, RandomWalk
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from asterism.model import TrackingModel

__all__ = ["ModelEstimate", "motion_levels", "reasons_for"]


@record
class ModelEstimate:
    """Model estimated from a capture, with the reason for each value.

    Parameters
    ----------
    model : TrackingModel
        Estimated model.
    reasons : tuple of (str, str, str)
        Parameter, value with unit and standard deviation, and reason; ``print(estimate)`` shows
        them as a table.
    stds : mapping of str to float
        Standard deviation of each estimated parameter, in the parameter's unit: ``noise_sigma``,
        ``motion`` (of its σ; ``motion_1`` and so on for several modes), ``p_detection``,
        ``p_redetection`` for bursts of missed detections, ``clutter_density``, and for an open
        population ``birth_density`` and ``p_disappear``. Parameters at a bound, and bounds, have
        none.

    Examples
    --------
    >>> import asterism as am
    >>> estimate = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections)
    >>> for parameter, value, reason in estimate.reasons[-3:]:
    ...     print(parameter, value, reason, sep=" | ")
    births λ_b | 0.053 /m³ | assumed: one in the capture
    deaths p_z | 0.0065 | assumed: one in the capture
    maximal gap d̄ | 28 frames | until a coasting track may be as far off as the nearest neighbour
    >>> sorted(estimate.stds)[:2]
    ['clutter_density', 'motion_1']
    """

    model: TrackingModel
    reasons: tuple[tuple[str, str, str], ...]
    stds: Mapping[str, float] = field(default_factory=dict[str, float])

    def __repr__(self) -> str:
        return f"ModelEstimate({len(self.stds)} stds, {self.model!r})"

    def __str__(self) -> str:
        from rich.cells import cell_len, set_cell_size  # the combining bar over v has no width

        width = max(cell_len(name) for name, _, _ in self.reasons)
        value = max(cell_len(text) for _, text, _ in self.reasons)
        return "\n".join(
            f"{set_cell_size(n, width)}  {set_cell_size(v, value)}  {why}"
            for n, v, why in self.reasons
        )


def motion_levels(model: TrackingModel) -> tuple[str, str, tuple[float, ...]]:
    """Return the symbol of a motion's σ, its unit, and its value for each mode.

    Parameters
    ----------
    model : TrackingModel
        Model with a random walk or DWNA modes.

    Returns
    -------
    symbol : str
        Name and symbol of σ.
    unit : str
        Unit of the values.
    values : tuple of float
        σ of each mode, in that unit.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> motion_levels(model)[:2]
    ('acceleration σ_a', 'm/s²')
    """
    modes = model.motion.modes
    if isinstance(modes[0], RandomWalk):
        return "walk σ_w", "m/√s", (modes[0].walk_sigma,)
    levels = tuple(mode.acceleration_sigma for mode in modes if isinstance(mode, DWNA))
    return "acceleration σ_a", "m/s²", levels


def reasons_for(
    model: TrackingModel,
    stds: Mapping[str, float],
    *,
    n_axes: int,
    n_links: int,
    n_misses: float,
    in_bursts: bool,
    n_clutter: float,
    n_frames: int,
    events: tuple[float, float] | None,
    min_noise: float,
) -> tuple[tuple[str, str, str], ...]:
    """Return the reason for each value of an estimated model.

    Parameters
    ----------
    model : TrackingModel
        Estimated model.
    stds : mapping of str to float
        Standard deviations, as in `ModelEstimate`.
    n_axes : int
        Number of coordinates, 2 or 3.
    n_links, n_misses, n_clutter, n_frames : float
        Numbers of links, missed detections, detections in no track, and frames that were counted.
    in_bursts : bool
        Whether missed detections may come in bursts.
    events : (float, float) or None
        Numbers of births and deaths; None for a closed population.
    min_noise : float
        Lower bound of the noise, metres.

    Returns
    -------
    tuple of (str, str, str)
        As in `ModelEstimate.reasons`.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> counts = {"n_links": 152, "n_misses": 0, "n_clutter": 0, "n_frames": 20}
    >>> settings = {"n_axes": 3, "in_bursts": False, "events": None, "min_noise": 2e-4}
    >>> reasons_for(model, {}, **counts, **settings)[0]
    ('noise σ', '0.2 mm', 'lower bound; the capture shows less, as smoothed captures do')
    """
    sensor, population = model.sensor, model.population
    name, unit, levels = motion_levels(model)
    volume = "m³" if n_axes == 3 else "m²"

    def sure(key: str, scale: float = 1.0) -> str:
        return f" ± {stds[key] * scale:.1g}" if key in stds else ""

    why_noise = f"maximum likelihood of one-step predictions, {n_links} links"
    if sensor.noise_sigma <= min_noise:
        why_noise = "lower bound; the capture shows less, as smoothed captures do"
    keys = ["motion"] if len(levels) == 1 else [f"motion_{k + 1}" for k in range(len(levels))]
    values = ", ".join(f"{x:.3g}{sure(key)}" for x, key in zip(levels, keys, strict=True))
    one = f"one {type(model.motion).__name__} explains the tracks as well as three motions"
    many = f"{len(levels)} motions between which a marker switches, fitted together"
    again: list[tuple[str, str, str]] = []
    if sensor.p_redetection is not None:
        value = f"{sensor.p_redetection:.4f}{sure('p_redetection')}"
        length = (
            f"missed detections come in bursts of {1 / sensor.p_redetection:.1f} frames on average"
        )
        again = [("redetection P_r", value, length)]
    elif in_bursts:
        again = [("redetection P_r", "P_d", "no more bursts of missed detections than by chance")]
    births, deaths = ("assumed: one in the capture",) * 2
    if events is not None:
        births = f"about {events[0]:.0f} after the first frame, in sampled partitions"
        deaths = f"about {events[1]:.0f} in sampled partitions"
    return (
        (
            "noise σ",
            f"{sensor.noise_sigma * 1e3:.3g}{sure('noise_sigma', 1e3)} mm",
            why_noise,
        ),
        (name, f"{values} {unit}", one if len(levels) == 1 else many),
        (
            "maximal speed v̄",
            f"{population.max_speed:.3g} m/s",
            "twice the speed that 1 link in 10 000 exceeds",
        ),
        (
            "detection P_d",
            f"{sensor.p_detection:.4f}{sure('p_detection')}",
            f"{n_misses:.0f} missed detections inside tracks of {n_links} links",
        ),
        *again,
        (
            "clutter λ_f",
            f"{sensor.clutter_density:.3g}{sure('clutter_density')} /{volume}",
            f"{n_clutter:.0f} detections in no track, {n_frames} frames",
        ),
        (
            "births λ_b",
            f"{population.birth_density:.2g}{sure('birth_density')} /{volume}",
            births,
        ),
        ("deaths p_z", f"{population.p_disappear:.2g}{sure('p_disappear')}", deaths),
        (
            "maximal gap d̄",
            f"{population.max_gap} frames",
            "until a coasting track may be as far off as the nearest neighbour",
        ),
    )
