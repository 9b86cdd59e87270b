"""The model from the clip: what the detections themselves say of noise, motion, misses and clutter.

Unambiguous links (mutual nearest neighbours far from any other choice) give the first scales. Then,
a few times over: track with the model so far, and re-estimate each parameter from the tracks. The
motion and the noise are those that make the tracks' detections most likely one step ahead.

What this file is not: a fit to truth. Names in the capture are never looked at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.associate.clip_evidence import Region, gather_evidence
from asterism.associate.clip_links import first_scales
from asterism.associate.motion_fit import FitBounds, MotionFit, fit_motion, simpler_motion
from asterism.errors import ParameterError
from asterism.model import (
    DWNA,
    Detections,
    InteractingMotions,
    Population,
    Sensor,
    TrackingModel,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from asterism.associate.clip_evidence import Evidence
    from asterism.associate.clip_links import Scales

__all__ = ["ModelEstimate", "estimate_model"]

SAMPLE_POINTS = 60_000
"""Longer captures are read in pieces, spread evenly, of so many detections in all."""
N_PIECES = 8
LEAST_FRAMES = 30
N_ROUNDS = 2
WIDER = 3.0
"""Tracks to learn the motion from are found with the strongest motion so many times stronger."""
LEAST_NOISE = 2e-4
"""Metres. Smoothed captures show less noise than that, but what the smoothing left of every jerk is
no white acceleration, and a tighter filter breaks on it; who is whom never hangs on a fifth of a
millimetre, unless points are so close that a hundredth of their spacing is less."""
SAFE_SHARE = 1 / 6
"""A jolt's σ may move a marker by this share of the points' spacing in a frame."""
LONGEST_GAP = 60
"""Frames; a longer gap is not bridged for the motion's sake."""


@dataclass(frozen=True, kw_only=True)
class ModelEstimate:
    """A model estimated from a clip, with the reason for each value.

    Parameters
    ----------
    model : TrackingModel
        The model.
    reasons : tuple of (str, str, str)
        Parameter, value with unit, and why.
    """

    model: TrackingModel
    reasons: tuple[tuple[str, str, str], ...]

    def __str__(self) -> str:
        width = max(len(name) for name, _, _ in self.reasons)
        value = max(len(text) for _, text, _ in self.reasons)
        return "\n".join(f"{n:<{width}}  {v:<{value}}  {why}" for n, v, why in self.reasons)


def estimate_model(detections: Detections) -> ModelEstimate:
    """Estimate the generative model from unlabelled detections.

    Parameters
    ----------
    detections : Detections
        A capture of at least a few frames in which markers can be followed; points that were filled
        are left out.

    Returns
    -------
    ModelEstimate

    Raises
    ------
    ParameterError
        If there are too few detections, or none that can be linked from frame to frame.
    """
    detections = detections.measured()
    if detections.n_frames < 3 or detections.n_points < 3:
        raise ParameterError(
            "detections",
            "at least 3 frames with points, to estimate a model from",
            f"{detections.n_frames} frames with {detections.n_points} points",
            "give a model",
        )
    pieces = list(_pieces(detections))
    scales = first_scales(pieces)
    region = Region.of(detections)
    low, high = scales.acceleration_low, scales.acceleration_high
    bounds = FitBounds(
        least_noise=scales.noise_floor,
        most_acceleration=2 * SAFE_SHARE * scales.spacing / scales.step**2,
    )
    fit = bounds.fit(
        math.log(scales.noise), (math.log(low), math.log(low * high) / 2, math.log(high)), 0.95
    )
    model = _first_model(fit, scales, region)
    evidence = gather_evidence(pieces, _wider(model))
    for _ in range(N_ROUNDS):
        fit = fit_motion(evidence.tracks, model, fit, bounds)
        model = _model(fit, evidence, scales, region)
        evidence = gather_evidence(pieces, _wider(model))
    fit = simpler_motion(evidence.tracks, model, fit, bounds)
    least_noise = max(scales.noise_floor, min(LEAST_NOISE, scales.spacing / 100))
    fit = replace(fit, noise=max(fit.noise, least_noise))
    # Motion is learnt with a wider model, but the rates are those of the model itself.
    evidence = gather_evidence(pieces, _model(fit, evidence, scales, region))
    model = _model(fit, evidence, scales, region)
    return ModelEstimate(model=model, reasons=_reasons(model, evidence, region, least_noise))


def _pieces(detections: Detections) -> Iterator[Detections]:
    """Up to `N_PIECES` runs of consecutive frames with `SAMPLE_POINTS` detections in all."""
    if detections.n_points <= SAMPLE_POINTS:
        yield detections
        return
    T, n = detections.n_frames, detections.n_points
    length = max(T * SAMPLE_POINTS // n // N_PIECES, min(T, LEAST_FRAMES))
    # Spread over the points, not over the frames, which may be empty for long.
    seeds = np.linspace(0, n - 1, max(1, min(N_PIECES, T // length))).astype(int)
    for start in np.unique(np.minimum(detections.frame_of[seeds], T - length)):
        a, b = detections.offsets[start], detections.offsets[start + length]
        yield Detections(
            times=detections.times[start : start + length],
            offsets=detections.offsets[start : start + length + 1] - a,
            points=detections.points[a:b],
        )


def _first_model(fit: MotionFit, scales: Scales, region: Region) -> TrackingModel:
    density = region.points_a_frame / region.volume
    return TrackingModel(
        motion=fit.motion(scales.speed),
        sensor=Sensor(noise_sigma=fit.noise, p_detection=0.9, clutter_density=0.1 * density),
        population=Population(
            birth_density=0.01 * density,
            p_disappear=1e-3,
            max_speed=3 * scales.top_speed,
            max_gap=10,
        ),
    )


def _wider(model: TrackingModel) -> TrackingModel:
    """Give a model whose strongest motion is stronger still.

    Tracks found with a model hold no jolt that the model would have lost, and a model fitted to
    them would lose more and more. Looking with a wider one than was fitted breaks the circle.
    """
    motion = model.motion
    if isinstance(motion, DWNA):
        strong = motion.acceleration_sigma * WIDER
        return replace(model, motion=replace(motion, acceleration_sigma=strong))
    if isinstance(motion, InteractingMotions) and isinstance(motion.models[-1], DWNA):
        jolt = motion.models[-1]
        wide = replace(jolt, acceleration_sigma=jolt.acceleration_sigma * WIDER)
        return replace(model, motion=replace(motion, models=(*motion.models[:-1], wide)))
    return model


def _model(fit: MotionFit, evidence: Evidence, scales: Scales, region: Region) -> TrackingModel:
    # Each rate with one event more than was seen: nothing is impossible after a finite clip. A
    # marker that comes or goes for good looks like a track that broke, so the clip is taken to have
    # one birth and one death, as most have.
    cells = region.volume * evidence.n_frames
    n_links = evidence.n_links
    top = float(np.quantile(evidence.speeds, 0.9999))
    p_detection = min((n_links + 1) / (n_links + evidence.n_misses + 2), 0.999)
    return TrackingModel(
        motion=fit.motion(max(evidence.velocity_rms, top / 4, 1e-9)),
        sensor=Sensor(
            noise_sigma=fit.noise,
            p_detection=p_detection,
            clutter_density=(evidence.n_clutter + 1) / cells,
        ),
        population=Population(
            birth_density=1 / cells,
            p_disappear=1 / (n_links + 2),
            max_speed=2 * top + 4 * fit.noise / scales.step,
            max_gap=_bridgeable(fit.levels, p_detection, n_links, scales),
        ),
    )


def _bridgeable(levels: tuple[float, ...], p_detection: float, n_links: int, scales: Scales) -> int:
    """Find d̄: how many frames a track can coast before it may be where its neighbour is.

    The position of a marker that coasts for k frames is known to ``σ_a Δ² √(k³ / 3)`` (DWNA);
    d̄ is where that reaches the spacing of the points, at most `LONGEST_GAP`, and long enough that
    less than one run of independent misses in the clip is longer.
    """
    drift = levels[len(levels) // 2] * scales.step**2
    reach = (3 * (scales.spacing / drift) ** 2) ** (1 / 3)
    needed = 1 - math.log(2 * n_links) / math.log(1 - p_detection)
    return max(3, round(max(min(reach, LONGEST_GAP), min(needed, 2 * LONGEST_GAP))))


def _reasons(
    model: TrackingModel, evidence: Evidence, region: Region, least_noise: float
) -> tuple[tuple[str, str, str], ...]:
    sensor, population = model.sensor, model.population
    levels = [
        f"{mode.acceleration_sigma:.3g}" for mode in model.motion.modes if isinstance(mode, DWNA)
    ]
    unit = "m³" if region.n_axes == 3 else "m²"
    why_noise = f"most likely one step ahead, {evidence.n_links} links"
    if sensor.noise_sigma <= least_noise:
        why_noise = "the least that is believed; the capture shows less, as smoothed ones do"
    one = "one motion explains them as well as three"
    many = f"{len(levels)} motions that a marker changes between, together most likely"
    return (
        ("noise σ", f"{sensor.noise_sigma * 1e3:.3g} mm", why_noise),
        ("acceleration σ_a", f"{', '.join(levels)} m/s²", one if len(levels) == 1 else many),
        (
            "maximal speed v̄",
            f"{population.max_speed:.3g} m/s",
            "twice the speed that 1 link in 10 000 exceeds",
        ),
        (
            "detection P_d",
            f"{sensor.p_detection:.4f}",
            f"{evidence.n_misses} misses inside tracks of {evidence.n_links} links",
        ),
        (
            "clutter λ_f",
            f"{sensor.clutter_density:.3g} /{unit}",
            f"{evidence.n_clutter} points in no track, {evidence.n_frames} frames",
        ),
        ("births λ_b", f"{population.birth_density:.2g} /{unit}", "one in the clip"),
        ("deaths p_z", f"{population.p_disappear:.2g}", "one in the clip"),
        (
            "maximal gap d̄",
            f"{population.max_gap} frames",
            "until a coasting marker may be as far off as its neighbour is",
        ),
    )
