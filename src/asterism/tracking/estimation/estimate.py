"""The model from the clip: what the detections themselves say of noise, motion, misses and clutter.

Unambiguous links (mutual nearest neighbours far from any other choice) give the first scales. Then,
a few times over: track with the model so far, and re-estimate each parameter from the tracks. The
motion and the noise are those that make the tracks' detections most likely one step ahead. Where
markers come and go, stochastic EM follows: partitions drawn from the posterior in place of tracks.

What this file is not: a fit to truth. Names in the capture are never looked at.
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
from asterism.tracking.estimation.model_estimate import ModelEstimate, motion_levels, reasons_for
from asterism.tracking.estimation.motion_fit import (
    WORTH,
    FitBounds,
    MotionFit,
    fit_motion,
    fit_one_motion,
    polish,
)
from asterism.tracking.estimation.rates import Counts, Rates
from asterism.tracking.estimation.scales import first_scales
from asterism.tracking.estimation.stochastic_em import draw_rates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from asterism.tracking.estimation.scales import Scales

__all__ = ["ModelEstimate", "estimate_model"]

log = logging.getLogger(__name__)

LARGEST = 100.0
"""Metres from the middle of a capture to its points, beyond which these are hardly metres."""
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
BLIND = 1.1
"""One motion may leave so many times as many misses and false points as three motions do."""
LONGEST_GAP = 60
"""Frames; a longer gap is not bridged for the motion's sake."""


def estimate_model(
    detections: Detections,
    *,
    population: Literal["closed", "open"] = "closed",
    misses: Literal["independent", "runs"] = "independent",
) -> ModelEstimate:
    """Estimate the generative model from unlabelled detections.

    Parameters
    ----------
    detections : Detections
        A capture of at least a few frames in which markers can be followed; points that were filled
        are left out.
    population : {"closed", "open"}
        Whether the markers are the same throughout, or come and go for good. A marker that goes
        cannot be told from one that hides for long, so this is not estimated: closed, the clip is
        taken to have one birth and one death, and tracks are held through long gaps; open, their
        rates are learnt with the rest by stochastic EM.
    misses : {"independent", "runs"}
        Whether a marker that was missed is as likely as any other to be seen in the next frame, or
        misses may come in runs, as those of markers behind limbs do: then
        `Sensor.p_redetection` is learnt as well, where the clip is sure that it is not P_d.

    Returns
    -------
    ModelEstimate

    Warns
    -----
    In the log, where the points lie so far apart that they are hardly metres.

    Raises
    ------
    ParameterError
        If there are too few detections, or none that can be linked from frame to frame.
    """
    check_fields("population", [population], ("closed", "open"))
    check_fields("misses", [misses], ("independent", "runs"))
    in_runs = misses == "runs"
    check_kind("detections", detections, Detections, "am.Detections.from_frames, or am.read")
    detections = detections.measured()
    if detections.n_frames < 3 or detections.n_points < 3:
        raise ParameterError(
            "detections",
            "at least 3 frames with points, to estimate a model from",
            f"{detections.n_frames} frames with {detections.n_points} points",
            "give a model",
        )
    _doubt_units(detections)
    pieces = list(_pieces(detections))
    scales = first_scales(pieces)
    region = Region.of(detections)

    def rates_of(evidence: Evidence) -> Rates:
        return _counts(evidence).rates(in_runs=in_runs)

    fit, evidence, bounds = _fitted(pieces, scales, region, rates_of)
    reach, least_noise = scales.spacing / 2, bounds.least_noise
    counts = (_counts(evidence),)
    rates = rates_of(evidence)
    if population == "open":

        def model_of(fit: MotionFit, rates: Rates, tracks: list[Tracks] | None) -> TrackingModel:
            seen = evidence if tracks is None else Evidence.of(tracks, reach)
            return _model(fit, rates, seen, scales, region)

        drawn = draw_rates(pieces, fit, rates, bounds, model_of, in_runs=in_runs)
        fit, rates, counts, evidence = (
            drawn.fit,
            drawn.rates,
            drawn.counts,
            Evidence.of(drawn.tracks, reach),
        )
    fit, sure = polish(evidence.tracks, _model(fit, rates, evidence, scales, region), fit, bounds)
    model = _model(fit, rates, evidence, scales, region)
    stds = _stds(counts, region, is_open=population == "open", in_runs=in_runs)
    stds |= _motion_stds(fit, model, sure, least_noise)
    mean = sum(counts, Counts()) * (1 / len(counts))
    reasons = reasons_for(
        model, stds, n_axes=region.n_axes, n_links=evidence.n_links,
        n_misses=mean.misses + mean.remisses, in_runs=in_runs, n_clutter=mean.clutter,
        n_frames=evidence.n_frames, least_noise=least_noise,
        events=(mean.births, mean.deaths) if population == "open" else None,
    )  # fmt: skip
    return ModelEstimate(model=model, reasons=reasons, stds=stds)


def _fitted(
    pieces: list[Detections],
    scales: Scales,
    region: Region,
    rates_of: Callable[[Evidence], Rates],
) -> tuple[MotionFit, Evidence, FitBounds]:
    """Fit one motion and three, and choose; with the tracks of the choice and its bounds."""
    reach = scales.spacing / 2
    low, high = scales.acceleration_low, scales.acceleration_high
    bounds = FitBounds(
        least_noise=scales.noise_floor,
        most_acceleration=2 * SAFE_SHARE * scales.spacing / scales.step**2,
    )
    fit = bounds.fit(
        math.log(scales.noise), (math.log(low), math.log(low * high) / 2, math.log(high)), 0.95
    )

    model = _first_model(fit, scales, region)
    evidence = gather_evidence(pieces, _wider(model), reach)
    fits: list[MotionFit] = []
    for _ in range(N_ROUNDS):
        fit = fit_motion(evidence.tracks, model, fit, bounds)
        fits.append(fit)
        model = _model(fit, rates_of(evidence), evidence, scales, region)
        evidence = gather_evidence(pieces, _wider(model), reach)
    least_noise = max(scales.noise_floor, min(LEAST_NOISE, scales.spacing / 100))
    bounds = replace(bounds, least_noise=least_noise)

    # Motion is learnt with a wider model, but the rates are those of the model itself, and so are
    # the tracks by which motions are compared.
    def tried(trial: MotionFit, evidence: Evidence) -> tuple[float, MotionFit, Evidence]:
        trial = replace(trial, noise=max(trial.noise, least_noise))
        by = _model(trial, rates_of(evidence), evidence, scales, region)
        found = gather_evidence(pieces, by, reach)
        model = _model(trial, rates_of(found), found, scales, region)
        # The bounds are those that the tracks were found within.
        bounds = {"max_speed": by.population.max_speed, "max_gap": by.population.max_gap}
        model = replace(model, population=replace(model.population, **bounds))
        return _log_evidence(found, model, region), trial, found

    # A fit sees a sample of the tracks, and may miss the few that move most: then it loses them.
    three = min((tried(fit, evidence) for fit in reversed(fits)), key=lambda trial: trial[2].n_lost)
    # One motion is learnt from tracks of its own, from the quietest on: those of three have jolts,
    # true or wrong, that it would have to explain.
    one = tried(replace(fit, levels=fit.levels[:1], stay=1.0), evidence)
    for _ in range(N_ROUNDS):
        one = tried(fit_one_motion(one[2].tracks, model, one[1], bounds), one[2])
    # One that loses what three hold is not simpler but blind, however well it foresees the rest.
    is_blind = one[2].n_lost > BLIND * three[2].n_lost + 1
    is_worth = three[0] - one[0] > WORTH * sum(p.n_points for p in pieces)
    _, fit, evidence = three if is_blind or is_worth else one
    return fit, evidence, bounds


def _doubt_units(detections: Detections) -> None:
    """Say so where a tenth of the points is too far from the middle for a volume in metres."""
    points = detections.points[:: 1 + detections.n_points // SAMPLE_POINTS]
    spread = np.abs(points - np.median(points, axis=0)).max(axis=1)
    far = float(np.quantile(spread, 0.9))
    if far > LARGEST:
        log.warning(
            "a tenth of the points is more than %.3g m from their middle: "
            "if these are millimetres, divide them by 1000", far,
        )  # fmt: skip


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
        yield detections.part(int(start), int(start) + length)


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


def _counts(evidence: Evidence) -> Counts:
    """Count as of a closed population, in which a track that ends is one that broke."""
    return Counts(
        **evidence.sightings._asdict(),
        steps=evidence.n_links,
        clutter=evidence.n_clutter,
        frames=evidence.n_frames,
    )


def _model(
    fit: MotionFit, rates: Rates, evidence: Evidence, scales: Scales, region: Region
) -> TrackingModel:
    top = float(np.quantile(evidence.speeds, 0.9999))
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
    counts: tuple[Counts, ...], region: Region, *, is_open: bool, in_runs: bool
) -> dict[str, float]:
    """Give what rates vary by within a partition, and from one drawn partition to the next."""
    within = (sum(counts, Counts()) * (1 / len(counts))).stds(in_runs=in_runs)
    each = [c.rates(in_runs=in_runs) for c in counts]

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
    """Log of the joint density of points and tracks, clutter included, under a model."""
    sensor, population = model.sensor, model.population
    log_clutter = math.log(sensor.clutter_density)
    events = (sensor.clutter_density + population.birth_density) * region.volume
    total = -events * evidence.n_frames
    for found in evidence.tracks:
        scores = track_scores(found, model)
        # A track of one detection, forbidden by the model, counts as the clutter that it is.
        total += float(scores[np.isfinite(scores)].sum()) + log_clutter * len(found.labels)
    return total


def _motion_stds(
    fit: MotionFit, model: TrackingModel, sure: tuple[float, ...] | None, least_noise: float
) -> dict[str, float]:
    if sure is None:
        return {}
    levels = motion_levels(model)[2]
    names = ["motion"] if len(levels) == 1 else [f"motion_{k + 1}" for k in range(len(levels))]
    stds = {n: s * x for n, s, x in zip(names, sure[1:], levels, strict=True)}
    return stds if fit.noise <= least_noise else {"noise_sigma": sure[0] * fit.noise} | stds


def _bridgeable(fit: MotionFit, p_seen: float, n_links: int, scales: Scales) -> int:
    """Find d̄: how many frames a track can coast before it may be where its neighbour is.

    The position of a marker that coasts for k frames is known to ``σ_a Δ² √(k³ / 3)`` (DWNA) or
    ``σ_w √(k Δ)`` (random walk); d̄ is where that reaches the spacing of the points, at most
    `LONGEST_GAP`, and long enough that less than one run of independent misses in the clip is
    longer.
    """
    level = fit.levels[len(fit.levels) // 2]
    if fit.kind == "random_walk":
        reach = (scales.spacing / level) ** 2 / scales.step
    else:
        reach = (3 * (scales.spacing / (level * scales.step**2)) ** 2) ** (1 / 3)
    needed = 1 - math.log(2 * n_links) / math.log(1 - p_seen)
    return max(3, round(max(min(reach, LONGEST_GAP), min(needed, 2 * LONGEST_GAP))))
