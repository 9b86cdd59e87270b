"""Estimation of the tracking model from unlabelled detections.

Unambiguous links (mutual nearest neighbours far from any alternative) yield the first scales. Then
two steps alternate: track with the current model, and re-estimate each parameter from the tracks.
Motion and noise maximise the one-step predictive likelihood of the tracks' detections. For an open
population stochastic EM follows, with partitions drawn from the posterior instead of tracks.

Names in the capture are not used.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from asterism.checks import check_fields, check_kind
from asterism.errors import ParameterError
from asterism.model import (
    DWNA,
    Detections,
    InteractingMotions,
    Population,
    Sensor,
    TrackingModel,
    Tracks,
)
from asterism.model.posterior import track_scores
from asterism.tracking.estimation.evidence import Evidence, Region, gather_evidence
from asterism.tracking.estimation.fitted_motion import MotionFit
from asterism.tracking.estimation.model_estimate import ModelEstimate, motion_levels, reasons_for
from asterism.tracking.estimation.motion_fit import (
    MIN_GAIN,
    FitBounds,
    fit_motion,
    fit_one_motion,
    polish,
)
from asterism.tracking.estimation.rates import Counts, Rates
from asterism.tracking.estimation.sampling import Runs, sample_runs
from asterism.tracking.estimation.scales import first_scales, quantile
from asterism.tracking.estimation.stochastic_em import draw_rates

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.tracking.estimation.scales import Scales

__all__ = ["ModelEstimate", "estimate_model"]

log = logging.getLogger(__name__)

MAX_EXTENT = 100.0
"""Distance from a capture's centre, metres, beyond which points are probably not in metres."""
FIT_POINTS = 8_000
"""Number of detections in the frames to which motion and noise are fitted."""
COUNT_POINTS = 30_000
"""Number of detections in the frames in which events are counted."""
UNIT_POINTS = 2_000
"""Number of detections by which the unit of length is checked."""
WIDER = 3.0
"""Factor on the strongest motion of the model that finds the tracks for the motion fit."""
MIN_NOISE = 2e-4
"""Lower bound of the noise, metres. Smoothed captures show less noise, but their residual
accelerations are not white, and a filter with less noise loses tracks. Association does not depend
on a fifth of a millimetre, unless a hundredth of the points' spacing is smaller."""
NEGLIGIBLE = 10.0
"""Ratio of `MIN_NOISE` to the lower bound of the noise in fits of several motions. Captures without
noise are tracked as well as with a lower bound, and the search for less noise takes many steps."""
SAFE_SHARE = 1 / 6
"""Largest displacement of a marker by one σ of a jolt in a frame, as a share of the spacing."""
BLIND = 1.1
"""Largest ratio of missed detections and false alarms of one motion to those of three motions."""
MAX_GAP = 60
"""Largest d̄ that follows from the motion, frames."""


def estimate_model(
    detections: Detections,
    *,
    population: Literal["closed", "open"] = "closed",
    misses: Literal["independent", "bursts"] = "independent",
) -> ModelEstimate:
    """Estimate the generative model from unlabelled detections.

    Parameters
    ----------
    detections : Detections
        Capture of at least a few frames in which markers can be followed. Filled points are left
        out.
    population : {"closed", "open"}
        Whether all markers are present throughout ("closed") or appear and disappear permanently
        ("open"). It is not estimated, because a marker that disappears cannot be distinguished
        from a long occlusion. "closed" assumes one birth and one death in the capture and keeps
        tracks through long gaps; "open" estimates birth and death rates by stochastic EM.
    misses : {"independent", "bursts"}
        Whether missed detections are independent or may come in bursts ("bursts"), as occlusions by
        limbs do. "bursts" also estimates `Sensor.p_redetection`, if it differs significantly from
        P_d.

    Returns
    -------
    ModelEstimate
        Model, the reason for each value, and standard deviations. A log message warns if the points
        lie too far apart for coordinates in metres.

    Raises
    ------
    ParameterError
        If there are too few detections, or none can be linked from frame to frame.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.wander(frames=100, rate=100, seed=1)
    >>> corrupted = am.simulate.corrupt(truth, missing=0.1, noise=1e-3, seed=1)
    >>> estimate = am.estimate_model(corrupted.detections)
    >>> type(estimate.model.motion).__name__
    'DWNA'
    >>> round(estimate.model.sensor.p_detection, 2)
    0.9
    """
    check_fields("population", [population], ("closed", "open"))
    check_fields("misses", [misses], ("independent", "bursts"))
    in_bursts = misses == "bursts"
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    detections = detections.measured()
    if detections.n_frames < 3 or detections.n_points < 3:
        frames = "1 frame" if detections.n_frames == 1 else f"{detections.n_frames} frames"
        raise ParameterError(
            "detections",
            "at least 3 points in at least 3 frames, to estimate a model from",
            f"{detections.n_points} points in {frames}",
            "give a model",
        )
    _check_units(detections)
    scales, activity = first_scales(detections)
    region = Region.of(detections)

    def rates_of(evidence: Evidence) -> Rates:
        return _counts(evidence).rates(in_bursts=in_bursts)

    runs = Runs(pieces=sample_runs(detections, activity, FIT_POINTS))
    fit, fitted, bounds = _fitted(runs, scales, region, rates_of)
    reach, min_noise = scales.spacing / 2, bounds.min_noise
    runs = Runs(pieces=sample_runs(detections, activity, COUNT_POINTS))
    model = _model(fit, rates_of(fitted), fitted, scales, region)
    evidence = gather_evidence(runs, model, reach)
    counts = (_counts(evidence),)
    rates = rates_of(evidence)
    if population == "open":

        def model_of(fit: MotionFit, rates: Rates, evidence: Evidence) -> TrackingModel:
            return _model(fit, rates, evidence, scales, region)

        drawn = draw_rates(evidence, fit, rates, bounds, model_of, reach, in_bursts=in_bursts)
        fit, rates, counts, evidence = drawn.fit, drawn.rates, drawn.counts, drawn.evidence
    fit, sure = polish(evidence.tracks, _model(fit, rates, evidence, scales, region), fit, bounds)
    model = _model(fit, rates, evidence, scales, region)
    stds = _stds(counts, region, is_open=population == "open", in_bursts=in_bursts)
    stds |= _motion_stds(fit, model, sure, min_noise)
    mean = sum(counts, Counts()) * (1 / len(counts))
    reasons = reasons_for(
        model, stds, n_axes=region.n_axes, n_links=evidence.n_links,
        n_misses=mean.misses + mean.remisses, in_bursts=in_bursts, n_clutter=mean.clutter,
        n_frames=evidence.n_frames, min_noise=min_noise,
        events=(mean.births, mean.deaths) if population == "open" else None,
    )  # fmt: skip
    return ModelEstimate(model=model, reasons=reasons, stds=stds)


def _fitted(
    runs: Runs,
    scales: Scales,
    region: Region,
    rates_of: Callable[[Evidence], Rates],
) -> tuple[MotionFit, Evidence, FitBounds]:
    """Fit one motion and three motions, and return the better fit with its tracks and bounds."""
    reach = scales.spacing / 2
    low, high = scales.acceleration_low, scales.acceleration_high
    min_noise = max(scales.noise_floor, min(MIN_NOISE, scales.spacing / 100))
    bounds = FitBounds(
        min_noise=max(scales.noise_floor, min_noise / NEGLIGIBLE),
        max_acceleration=2 * SAFE_SHARE * scales.spacing / scales.step**2,
    )
    levels = (low, math.sqrt(low * high), high)
    fit = bounds.clip(MotionFit(noise=scales.noise, levels=levels, stay=0.95))
    model = _first_model(fit, scales, region)
    evidence = gather_evidence(runs, _wider(model), reach)
    fit = fit_motion(evidence.tracks, model, fit, bounds)
    model = _model(fit, rates_of(evidence), evidence, scales, region)
    evidence = gather_evidence(runs, _wider(model), reach)
    fit = fit_motion(evidence.tracks, model, fit, bounds, refine=True)
    bounds = replace(bounds, min_noise=min_noise)

    def tracked(trial: MotionFit, evidence: Evidence) -> tuple[Evidence, TrackingModel]:
        """Track with a fit and with the rates of earlier tracks."""
        by = _model(trial, rates_of(evidence), evidence, scales, region)
        return gather_evidence(runs, by, reach), by

    # The motion is fitted to tracks of a wider model. The rates, and the tracks by which motions
    # are compared, are those of the model itself.
    def gain(trial: MotionFit, found: Evidence, by: TrackingModel) -> float:
        model = _model(trial, rates_of(found), found, scales, region)
        # The bounds are those with which the tracks were found.
        limits = {"max_speed": by.population.max_speed, "max_gap": by.population.max_gap}
        model = replace(model, population=replace(model.population, **limits))
        return _log_evidence(found, model, region)

    three = bounds.clip(fit)
    of_three, by_three = tracked(three, evidence)
    # One motion is fitted to tracks of its own, those of the quietest motion. Tracks of three
    # motions contain jolts, true or wrong, that a single motion would have to explain.
    one = bounds.clip(replace(fit, levels=fit.levels[:1], stay=1.0))
    of_one, _ = tracked(one, evidence)
    one = bounds.clip(fit_one_motion(of_one.tracks, model, one, bounds))
    of_one, by_one = tracked(one, of_one)
    # One motion is rejected if it loses markers that three motions keep, however well it predicts
    # the remaining ones.
    if of_one.n_lost > BLIND * of_three.n_lost + 1:
        return three, of_three, bounds
    more = gain(three, of_three, by_three) - gain(one, of_one, by_one)
    if more > MIN_GAIN * runs.joined.n_points:
        return three, of_three, bounds
    return one, of_one, bounds


def _check_units(detections: Detections) -> None:
    """Log a warning if a tenth of the points is too far from the centre for metres."""
    points = detections.points[:: 1 + detections.n_points // UNIT_POINTS]
    spread = np.abs(points - np.median(points, axis=0)).max(axis=1)
    far = quantile(spread, 0.9)
    if far > MAX_EXTENT:
        log.warning(
            "a tenth of the points is more than %.3g m from their median: "
            "expected metres; divide millimetres by 1000", far,
        )  # fmt: skip


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
    """Return a copy of the model with a stronger strongest motion.

    Tracks found with a model contain no jolt that the model would have lost, so repeated fits
    would shrink the motion. Tracking with a wider model than the fitted one prevents this.
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


def _counts(evidence: Evidence) -> Counts:
    """Count as for a closed population, in which the end of a track is a lost track."""
    return Counts(
        **evidence.sightings._asdict(),
        steps=evidence.n_links,
        clutter=evidence.n_clutter,
        frames=evidence.n_frames,
    )


def _model(
    fit: MotionFit, rates: Rates, evidence: Evidence, scales: Scales, region: Region
) -> TrackingModel:
    top = evidence.top_speed
    return TrackingModel(
        motion=fit.motion(max(evidence.velocity_rms, top / 4, 1e-9)),
        sensor=Sensor(
            noise_sigma=fit.noise,
            p_detection=rates.p_detection,
            clutter_density=rates.clutter / region.volume,
            p_redetection=None if rates.p_redetection == rates.p_detection else rates.p_redetection,
        ),
        population=Population(
            birth_density=rates.births / region.volume,
            p_disappear=rates.p_disappear,
            max_speed=2 * top + 4 * fit.noise / scales.step,
            max_gap=_bridgeable(fit, rates.p_seen, evidence.n_links, scales),
        ),
    )


def _stds(
    counts: tuple[Counts, ...], region: Region, *, is_open: bool, in_bursts: bool
) -> dict[str, float]:
    """Return the standard deviations of rates, within and between drawn partitions."""
    within = (sum(counts, Counts()) * (1 / len(counts))).stds(in_bursts=in_bursts)
    each = [c.rates(in_bursts=in_bursts) for c in counts]

    def std(name: str) -> float:
        between = np.var([getattr(r, name) for r in each]) * (1 + 1 / len(each))
        return float(np.hypot(getattr(within, name), np.sqrt(between)))

    stds = {"p_detection": std("p_detection"), "clutter_density": std("clutter") / region.volume}
    if any(r.p_redetection != r.p_detection for r in each):
        stds["p_redetection"] = std("p_redetection")
    if is_open:
        stds |= {"birth_density": std("births") / region.volume, "p_disappear": std("p_disappear")}
    return stds


def _log_evidence(evidence: Evidence, model: TrackingModel, region: Region) -> float:
    """Return the log joint density of points and tracks, including clutter, under a model."""
    sensor, population = model.sensor, model.population
    log_clutter = math.log(sensor.clutter_density)
    events = (sensor.clutter_density + population.birth_density) * region.volume
    total = -events * evidence.n_frames
    pieces = evidence.runs.pieces
    for piece, labels in zip(pieces, evidence.labels, strict=True):
        is_whole = len(pieces) == 1
        tracks = evidence.tracks if is_whole else Tracks(detections=piece, labels=labels)
        scores = track_scores(tracks, model)
        # The model forbids a track of one detection, so it counts as clutter.
        total += float(scores[np.isfinite(scores)].sum()) + log_clutter * len(labels)
    return total


def _motion_stds(
    fit: MotionFit, model: TrackingModel, sure: tuple[float, ...], min_noise: float
) -> dict[str, float]:
    levels = motion_levels(model)[2]
    names = ["motion"] if len(levels) == 1 else [f"motion_{k + 1}" for k in range(len(levels))]
    stds = {n: s * x for n, s, x in zip(names, sure[1:], levels, strict=True)}
    if fit.noise > min_noise:
        stds = {"noise_sigma": sure[0] * fit.noise} | stds
    return {name: std for name, std in stds.items() if np.isfinite(std)}


def _bridgeable(fit: MotionFit, p_seen: float, n_links: int, scales: Scales) -> int:
    """Compute d̄: the number of frames for which a track can coast before it is ambiguous.

    After k frames without a detection the position of a marker is known to ``σ_a Δ² √(k³ / 3)``
    (DWNA) or ``σ_w √(k Δ)`` (random walk). d̄ is the k at which this reaches the spacing of the
    points, at most `MAX_GAP`, and large enough that fewer than one burst of independent missed
    detections in the capture is longer.
    """
    level = fit.levels[len(fit.levels) // 2]
    if fit.kind == "random_walk":
        reach = (scales.spacing / level) ** 2 / scales.step
    else:
        reach = (3 * (scales.spacing / (level * scales.step**2)) ** 2) ** (1 / 3)
    needed = 1 - math.log(2 * n_links) / math.log(1 - p_seen)
    return max(3, round(max(min(reach, MAX_GAP), min(needed, 2 * MAX_GAP))))
