"""Stochastic EM (Celeux & Diebolt 1985) for an open population of markers.

Partitions of the capture are drawn from the posterior under the current model (Oh, Russell & Sastry
2009), and the model is re-estimated from each of them. The most probable partition would bias the
estimate, because it contains every false alarm that fits a track.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation.evidence import Evidence
from asterism.tracking.estimation.motion_fit import FitBounds, fit_motion, fit_one_motion
from asterism.tracking.estimation.rates import Counts, Rates, count
from asterism.tracking.estimation.sampling import Runs
from asterism.tracking.methods.mcmcda import MCMCDA

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.tracking.estimation.fitted_motion import MotionFit

__all__ = ["Drawn", "draw_rates"]

N_ROUNDS = 6
N_KEPT = 3
"""Number of last rounds; their differences measure the uncertainty of the partition."""
DRAWN_POINTS = 15_000
"""Number of detections in the pieces whose partitions are drawn."""
_WALK = MCMCDA(moves=25.0, keep="draw", confidence=0.0, end_odds=1.0)


@record(eq=False)
class Drawn:
    """Result of stochastic EM.

    Parameters
    ----------
    evidence : Evidence
        Last partition of the pieces.
    counts : tuple of Counts
        Counts of the last rounds.
    rates : Rates
        Rates from the mean of these counts.
    fit : MotionFit
        Fit to the last partition.
    """

    evidence: Evidence
    counts: tuple[Counts, ...]
    rates: Rates
    fit: MotionFit


def draw_rates(
    evidence: Evidence,
    fit: MotionFit,
    rates: Rates,
    bounds: FitBounds,
    model_of: Callable[[MotionFit, Rates, Evidence], TrackingModel],
    reach: float,
    *,
    in_bursts: bool,
) -> Drawn:
    """Estimate rates and motion from partitions drawn from the posterior.

    Parameters
    ----------
    evidence : Evidence
        Runs of consecutive frames of the capture, and their first tracks.
    fit : MotionFit
        Initial motion.
    rates : Rates
        Initial rates.
    bounds : FitBounds
        Bounds of noise and motion.
    model_of : callable
        Function that returns the model for a motion, rates and the current partition.
    reach : float
        As in `count_sightings`, metres.
    in_bursts : bool
        As for `Counts.rates`.

    Returns
    -------
    Drawn
    """
    runs = Runs(pieces=_some(evidence.runs.pieces))
    n_runs = len(runs.pieces)
    model = model_of(fit, rates, evidence)
    kept: list[Counts] = []
    for n in range(N_ROUNDS):
        tracks = [_draw(piece, model, n * n_runs + k) for k, piece in enumerate(runs.pieces)]
        kept = [*kept, sum((count(t, rates) for t in tracks), Counts())][-N_KEPT:]
        rates = (sum(kept, Counts()) * (1 / len(kept))).rates(in_bursts=in_bursts)
        evidence = Evidence.of(runs, [found.labels for found in tracks], reach)
        fit_again = fit_one_motion if len(fit.levels) == 1 else fit_motion
        fit = fit_again(evidence.tracks, model, fit, bounds)
        model = model_of(fit, rates, evidence)
    return Drawn(evidence=evidence, counts=tuple(kept), rates=rates, fit=fit)


def _draw(piece: Detections, model: TrackingModel, seed: int) -> Tracks:
    """Draw a partition; each frame is drawn given the frames before it and the nine after it."""
    state = _WALK.init(model, n_axes=piece.n_axes, seed=seed)
    return Tracks(detections=piece, labels=_WALK.run(state, piece)[1])


def _some(pieces: list[Detections]) -> list[Detections]:
    """Select evenly spread pieces of `DRAWN_POINTS` detections, or the start of a single one."""
    total = sum(piece.n_points for piece in pieces)
    n = max(1, min(len(pieces), len(pieces) * DRAWN_POINTS // max(total, 1)))
    chosen = [pieces[k] for k in np.unique(np.linspace(0, len(pieces) - 1, n).astype(int))]
    if n > 1 or chosen[0].n_points <= DRAWN_POINTS:
        return chosen
    whole = chosen[0]
    T = max(3, int(np.searchsorted(whole.offsets, DRAWN_POINTS)))
    return [whole.part(0, T)]
