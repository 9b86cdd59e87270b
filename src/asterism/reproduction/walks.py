"""What the parts about MCMCDA share: the report's cube, the report's own chain, and its scores."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.reproduction.rules import spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["HEAD", "Clip", "Scores", "clips", "floors", "our_chain", "row", "walked"]

FRAMES, NOISE, MAX_SPEED = 100, 0.005, 0.15
HEAD = ("", "moves a frame", "% wrong, report's sense", "% wrong", "tracks", "% missing", "IDF1",
        "nats above the floor")  # fmt: skip
"""Of the tables of scores."""


def our_chain(*, moves: float, **chain: Any) -> am.MCMCDA:
    """Make Asterism's chain over the model's own posterior, with some options of the chain."""
    options = am.tracking.ChainOptions(**chain)
    return am.MCMCDA(moves=moves, confidence=0, end_odds=1, chain=options)


@dataclass(frozen=True)
class Clip:
    """A recording of the report's cube, with the model that it is tracked by."""

    truth: am.Tracks
    model: am.TrackingModel
    seed: int


@dataclass(frozen=True, kw_only=True)
class Scores:
    """What came out, each an array with one entry a clip.

    Attributes
    ----------
    wrong : ndarray
        Percent of the labelled detections whose marker is not their track's.
    strict : ndarray
        Percent wrong in the report's sense: what is in a track beyond one for each marker is wrong
        too, however pure (100 · (1 − IDP)).
    correct : ndarray
        Percent of the markers' detections that are in the one track of their marker (100 · IDR).
    tracks, missing, idf1, nats, moves, seconds : ndarray
        Generated tracks; percent of the markers' detections without a label; IDF1; log posterior
        above that of the floor; moves a frame; seconds for the whole clip.
    """

    wrong: NDArray[np.float64]
    strict: NDArray[np.float64]
    correct: NDArray[np.float64]
    tracks: NDArray[np.float64]
    missing: NDArray[np.float64]
    idf1: NDArray[np.float64]
    nats: NDArray[np.float64]
    moves: NDArray[np.float64]
    seconds: NDArray[np.float64]


def clips(seeds: int, *, max_gap: int, missing: float = 0.1, clutter: float = 0.1) -> list[Clip]:
    """Make recordings of the cube; motion and rates are estimated from each.

    Parameters
    ----------
    seeds : int
        How many.
    max_gap : int
        The report's d̄, frames.
    missing, clutter : float
        Shares of the detections.
    """
    found: list[Clip] = []
    for seed in range(seeds):
        scene = am.simulate.cube(frames=FRAMES, seed=seed)
        truth = am.simulate.corrupt(scene, missing=missing, clutter=clutter, noise=NOISE, seed=seed)
        model = am.estimate_model(truth.detections).model
        population = dataclasses.replace(model.population, max_speed=MAX_SPEED, max_gap=max_gap)
        found.append(Clip(truth, dataclasses.replace(model, population=population), seed))
    return found


def floors(some: Sequence[Clip]) -> list[am.Tracks]:
    """Give the truth of each clip, broken at every gap that d̄ does not span."""
    return [am.metrics.oracle_tracks(clip.truth, clip.model.population.max_gap) for clip in some]


def walked(some: Sequence[Clip], method: am.MCMCDA | None) -> Scores:
    """Track every clip and score it; the floors themselves without a method."""
    columns: dict[str, list[float]] = {f.name: [] for f in dataclasses.fields(Scores)}
    for clip, best in zip(some, floors(some), strict=True):
        start = time.perf_counter()
        tracks = best
        if method is not None:
            tracks = am.track(clip.truth.detections, method, model=clip.model, seed=clip.seed)
        seconds = time.perf_counter() - start
        e = am.evaluate(tracks, clip.truth)
        gain = 0.0
        if method is not None:
            gain = tracks.info["log_posterior"] - am.log_posterior(best, clip.model)
        values = {
            "wrong": e.wrong_percent if np.isfinite(e.wrong_percent) else 0.0,
            "strict": 100 * (1 - e.idp) if np.isfinite(e.idp) else 0.0,
            "correct": 100 * e.idr,
            "tracks": e.n_tracks,
            "missing": e.missing_percent,
            "idf1": e.idf1,
            "nats": gain,
            "moves": tracks.info["moves"] / FRAMES if method is not None else 0.0,
            "seconds": seconds,
        }
        for name, value in values.items():
            columns[name].append(float(value))
    return Scores(**{name: np.array(values) for name, values in columns.items()})


def row(name: str, found: Scores) -> list[str]:
    """Give scores as a row of a table under `HEAD`: means and standard deviations."""
    moves = float(found.moves.mean())
    return [
        name,
        f"{moves:.0f}" if moves else "–",
        spread(found.strict),
        spread(found.wrong),
        spread(found.tracks, 1),
        spread(found.missing),
        spread(found.idf1, 3),
        _nats(found.nats.mean()) if moves else "0",
    ]


def _nats(value: float) -> str:
    text = f"{value:+.1f}"
    return text.replace("-", "−") if float(text) else "0.0"
