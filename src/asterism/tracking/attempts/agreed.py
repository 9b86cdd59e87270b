"""Searches by MCMCDA with ever more moves, until two independent ones agree."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.attempt import attempt
from asterism.tracking.attempts.halves import Halves

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe, Tracks
    from asterism.tracking.attempts.uncorrected import Uncorrected
    from asterism.tracking.methods import Method

__all__ = ["until_agreed"]

NEAR = 1.0
"""Largest difference between the log posteriors of two searches that agree, nats."""
MORE, MAX_MOVES = 4, 1600
"""Factor by which the moves grow if they do not, and the largest number of moves."""


def until_agreed(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Uncorrected:
    """Search twice with independent chains, with ever more moves until both agree.

    The most probable of all results is returned, with the recipe of its search alone and in it as
    reason how far the last two agree.

    Parameters
    ----------
    recipe, detections, method, start, progress
        As for `asterism.tracking.carry_out`; the method is `MCMCDA`.
    """
    parts = Halves(detections.n_frames, progress)
    moves, seed, best = recipe.options["moves"], recipe.seed or 0, None
    while True:
        once = dataclasses.replace(recipe, retry=False, options={**recipe.options, "moves": moves})
        pair = [
            attempt(
                dataclasses.replace(once, seed=seed + k), detections, start=start,
                progress=parts.next(),
            )
            for k in range(2)
        ]  # fmt: skip
        best = max([best, *pair] if best else pair, key=_log_posterior)
        apart = abs(_log_posterior(pair[0]) - _log_posterior(pair[1]))
        if apart <= NEAR or moves >= MAX_MOVES:
            break
        moves *= MORE
    how = "agree within 1 nat" if apart <= NEAR else f"still differ by {apart:.1f} nats"
    reason = f"{recipe.reason}; two searches with {moves:g} moves {how}"
    found = dataclasses.replace(best.recipe, reason=reason)
    parts.end()
    tracks = dataclasses.replace(best.tracks, recipe=found)
    return dataclasses.replace(best, tracks=tracks, recipe=found)


def _log_posterior(found: Uncorrected) -> float:
    return float(found.tracks.info["log_posterior"])
