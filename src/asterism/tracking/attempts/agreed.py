"""Searches by MCMCDA with ever more moves, until two independent ones agree."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.attempt import attempt

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe
    from asterism.tracking.attempts.uncorrected import Uncorrected

__all__ = ["until_agreed"]

AGREEMENT = 1e-3
"""Largest difference between the log posteriors of two searches that agree, nats per detection. It
is at least 1 nat for the capture."""
GROWTH = (1, 4, 16)
"""Moves of a search in those of the recipe, from one pair of searches to the next."""


def until_agreed(
    recipe: Recipe, detections: Detections, progress: Callable[[int], Any] | None = None
) -> Uncorrected:
    """Search twice with independent chains, with ever more moves until both agree.

    The most probable of all results is returned. Its recipe repeats that one search, and its reason
    states whether the last two searches agreed.

    Parameters
    ----------
    recipe, detections, progress
        As for `asterism.tracking.carry_out`; the method is `MCMCDA`.
    """
    n, done, whole = detections.n_frames, 0, 2 * sum(GROWTH)
    best, moves, apart, is_agreed = None, 0.0, 0.0, False

    def advance(frames: int) -> None:
        if progress is not None:
            progress((done * n + growth * frames) // whole)

    for growth in GROWTH:
        moves = growth * recipe.options["moves"]
        once = dataclasses.replace(recipe, retry=False, options={**recipe.options, "moves": moves})
        pair = []
        for k in range(2):
            searched = dataclasses.replace(once, seed=(recipe.seed or 0) + k)
            pair.append(attempt(searched, detections, progress=advance))
            done += growth
        best = max([*pair] if best is None else [best, *pair], key=_log_posterior)
        apart = abs(_log_posterior(pair[0]) - _log_posterior(pair[1]))
        is_agreed = apart <= max(1.0, AGREEMENT * detections.n_points)
        if is_agreed:
            break
    if progress is not None:
        progress(n)
    assert best is not None
    how = "agree within" if is_agreed else "still differ by"
    reason = f"{recipe.reason}; two searches with {moves:g} moves {how} {apart:.1f} nats"
    found = dataclasses.replace(best.recipe, reason=reason)
    tracks = dataclasses.replace(best.tracks, recipe=found)
    return dataclasses.replace(best, tracks=tracks, recipe=found)


def _log_posterior(found: Uncorrected) -> float:
    return float(found.tracks.info["log_posterior"])
