"""Markers that come and go: stochastic EM (Celeux & Diebolt 1985).

Partitions of the clip are drawn from the posterior under the model so far (Oh, Russell & Sastry
2009), and the model is estimated anew from each as if it were the truth. The best partition would
be a biased teacher: it has every false point that fits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Detections, TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation.motion_fit import FitBounds, MotionFit, fit_motion, fit_one_motion
from asterism.tracking.estimation.rates import Counts, Rates, count
from asterism.tracking.methods.mcmcda import MCMCDA

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Drawn", "draw_rates"]

N_ROUNDS = 6
N_KEPT = 3
"""Of the last rounds, whose differences tell how much the partition itself is in doubt."""
DRAWN_POINTS = 15_000
"""Detections in the pieces from whose partitions is drawn."""
_WALK = MCMCDA(keep="draw", confidence=0.0, end_odds=1.0)


@record
class Drawn:
    """What stochastic EM came to.

    Parameters
    ----------
    tracks : list of Tracks
        The last partition of each piece.
    counts : tuple of Counts
        Of the last rounds.
    rates : Rates
        From the mean of these.
    fit : MotionFit
        From the last partition.
    """

    tracks: list[Tracks]
    counts: tuple[Counts, ...]
    rates: Rates
    fit: MotionFit


def draw_rates(
    pieces: list[Detections],
    fit: MotionFit,
    rates: Rates,
    bounds: FitBounds,
    model_of: Callable[[MotionFit, Rates, list[Tracks] | None], TrackingModel],
    *,
    in_runs: bool,
) -> Drawn:
    """Estimate rates and motion from drawn partitions.

    Parameters
    ----------
    pieces : list of Detections
        Runs of frames of the clip.
    fit : MotionFit
        Motion to begin with.
    rates : Rates
        Rates to begin with.
    bounds : FitBounds
        What is believed of the motion.
    model_of : callable
        Makes the model of a motion, rates and the tracks so far.
    in_runs : bool
        As of `Counts.rates`.

    Returns
    -------
    Drawn
    """
    pieces = _some(pieces)
    model = model_of(fit, rates, None)
    tracks: list[Tracks] = []
    kept: list[Counts] = []
    for n in range(N_ROUNDS):
        tracks = [_draw(piece, model, n * len(pieces) + k) for k, piece in enumerate(pieces)]
        kept = [*kept, sum((count(t, rates) for t in tracks), Counts())][-N_KEPT:]
        rates = (sum(kept, Counts()) * (1 / len(kept))).rates(in_runs=in_runs)
        fit = (fit_one_motion if len(fit.levels) == 1 else fit_motion)(tracks, model, fit, bounds)
        model = model_of(fit, rates, tracks)
    return Drawn(tracks=tracks, counts=tuple(kept), rates=rates, fit=fit)


def _draw(piece: Detections, model: TrackingModel, seed: int) -> Tracks:
    """Draw a partition; frames are drawn given those before and the nine after."""
    state = _WALK.init(model, n_axes=piece.n_axes, seed=seed)
    return Tracks(detections=piece, labels=_WALK.run(state, piece)[1])


def _some(pieces: list[Detections]) -> list[Detections]:
    """Take pieces of `DRAWN_POINTS` detections in all, spread evenly; of a single one the start."""
    total = sum(piece.n_points for piece in pieces)
    n = max(1, min(len(pieces), len(pieces) * DRAWN_POINTS // max(total, 1)))
    chosen = [pieces[k] for k in np.unique(np.linspace(0, len(pieces) - 1, n).astype(int))]
    if n > 1 or chosen[0].n_points <= DRAWN_POINTS:
        return chosen
    whole = chosen[0]
    T = max(3, int(np.searchsorted(whole.offsets, DRAWN_POINTS)))
    return [whole.part(0, T)]
