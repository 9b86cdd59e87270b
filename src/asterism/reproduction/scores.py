"""Captures of the report's cube, chains that track them, and their scores."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import asterism as am
from asterism.reproduction.part import Table
from asterism.reproduction.rules import spread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

__all__ = ["FRAMES", "PER", "Capture", "Scores", "compare", "cubes", "own_chain", "score_table"]

FRAMES, NOISE, MAX_SPEED = 100, 0.005, 0.15
PER = 8.8
"""Mean number of detections or tracks in a frame, by which moves per frame are divided."""


def own_chain(*, moves: float, **chain: Any) -> am.MCMCDA:
    """Return Asterism's chain over all detections at once, with the unmodified posterior."""
    options = am.tracking.ChainOptions(groups="whole", **chain)
    return am.MCMCDA(moves=moves, confidence=0, end_odds=1, chain=options)


class Capture(NamedTuple):
    """Capture of the report's cube.

    Attributes
    ----------
    truth : Tracks
        True tracks.
    model : TrackingModel
        Model estimated from the capture.
    oracle : Tracks
        Tracks of the oracle.
    """

    truth: am.Tracks
    model: am.TrackingModel
    oracle: am.Tracks


class Scores(NamedTuple):
    """Scores of a method, each an array with one entry per capture.

    Attributes
    ----------
    moves, seconds : ndarray
        Moves per frame; time for the whole capture in seconds.
    strict : ndarray
        Percentage of wrong detections in the sense of the report: all detections in further tracks
        of a marker are wrong too, even if these tracks are pure (100 · (1 − IDP)).
    wrong, missing, correct : ndarray
        Percentage of the labelled detections with another marker than their track; of the markers'
        detections without a label; of these in the one track of their marker (100 · IDR).
    tracks, idf1 : ndarray
        Number of tracks; IDF1.
    gain : ndarray
        Log posterior minus that of the oracle, nats.
    example : Tracks
        Tracks of the first capture.
    """

    moves: NDArray[np.float64]
    seconds: NDArray[np.float64]
    strict: NDArray[np.float64]
    wrong: NDArray[np.float64]
    tracks: NDArray[np.float64]
    missing: NDArray[np.float64]
    correct: NDArray[np.float64]
    idf1: NDArray[np.float64]
    gain: NDArray[np.float64]
    example: am.Tracks


def cubes(seeds: int, *, max_gap: int, missing: float = 0.1, clutter: float = 0.1) -> list[Capture]:
    """Simulate captures of the cube, and estimate motion and rates from each.

    Parameters
    ----------
    seeds : int
        Number of captures.
    max_gap : int
        The report's d̄, frames. The oracle is the truth, broken at longer gaps.
    missing, clutter : float
        Share of missed detections, and of false alarms.

    Returns
    -------
    list of Capture
        One capture for each seed.
    """
    found: list[Capture] = []
    for seed in range(seeds):
        scene = am.simulate.cube(frames=FRAMES, seed=seed)
        truth = am.simulate.corrupt(scene, missing=missing, clutter=clutter, noise=NOISE, seed=seed)
        model = am.estimate_model(truth.detections).model
        population = dataclasses.replace(model.population, max_speed=MAX_SPEED, max_gap=max_gap)
        model = dataclasses.replace(model, population=population)
        found.append(Capture(truth, model, am.metrics.oracle_tracks(truth, max_gap)))
    return found


def compare(captures: Sequence[Capture], methods: Mapping[str, am.MCMCDA]) -> dict[str, Scores]:
    """Score the oracle and every method on all captures."""
    return {name: _scores(captures, methods.get(name)) for name in ("oracle", *methods)}


def _scores(captures: Sequence[Capture], method: am.MCMCDA | None) -> Scores:
    rows: list[tuple[float, ...]] = []
    shown: list[am.Tracks] = []
    for seed, (truth, model, oracle) in enumerate(captures):
        start = time.perf_counter()
        tracks = oracle
        if method is not None:
            tracks = am.track(truth.detections, method, model=model, seed=seed)
        seconds = time.perf_counter() - start
        e = am.evaluate(tracks, truth)
        gain = am.log_posterior(tracks, model) - am.log_posterior(oracle, model)
        wrong, strict = np.nan_to_num([e.wrong_percent, 100 * (1 - e.idp)])  # NaN: no labels
        rows.append((tracks.info.get("moves", 0) / FRAMES, seconds, strict, wrong, e.n_tracks,
                     e.missing_percent, 100 * e.idr, e.idf1, gain))  # fmt: skip
        shown.append(tracks)
    return Scores(*np.array(rows, dtype=np.float64).T, example=shown[0])


def score_table(title: str, found: Mapping[str, Scores]) -> Table:
    """Return the scores as a table of means and standard deviations."""
    head = ("", "moves a frame", "% wrong, report's sense", "% wrong", "tracks", "% missing",
            "IDF1", "nats above the oracle")  # fmt: skip
    rows = [
        [name, f"{s.moves.mean():.0f}", spread(s.strict), spread(s.wrong), spread(s.tracks, 1),
         spread(s.missing), spread(s.idf1, 3), f"{s.gain.mean():z.1f}".replace("-", "−")]
        for name, s in found.items()
    ]  # fmt: skip
    return Table(title, head, rows)
