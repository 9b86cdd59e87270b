"""One attempt at a capture: association by the method of a recipe, and stitching."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.own_distances import refined_by_own_distances
from asterism.tracking.attempts.slow_start import after_slow_start, with_slow_start
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.estimation import fit_to_tracks
from asterism.tracking.methods import METHODS, method_by_name
from asterism.tracking.methods.associate import associate
from asterism.tracking.stitching import stitch, tracklet_model

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe, TrackingModel, Tracks
    from asterism.tracking.methods import Method

__all__ = ["attempt", "next_pass"]


def attempt(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Uncorrected:
    """Associate by the method of a recipe, and stitch.

    Parameters
    ----------
    recipe, detections, method, start, progress
        As for `carry_out`.
    """
    made = method_by_name(recipe.method, **recipe.options) if method is None else method
    model = tracklet_model(recipe.model) if recipe.stitch else recipe.model
    first = dataclasses.replace(recipe, passes=1)
    # Stitched tracks have no log posterior.
    tracks = associate(
        made, detections, model, seed=recipe.seed, start=start,
        recipe=first if made.name in METHODS else None,
        score=not recipe.stitch, progress=progress,
    )  # fmt: skip
    found = _stitched(tracks, first, model)
    for _ in range(1, recipe.passes):
        found = next_pass(refined_by_own_distances(found))
    return found


def next_pass(found: Uncorrected, progress: Callable[[int], Any] | None = None) -> Uncorrected:
    """Associate a capture once more by the same method, with bonds and motion of the tracks so far.

    The method first learns the bonds in a slow start; noise and motion are fitted to the tracks.

    Parameters
    ----------
    found : Uncorrected
        Tracks of the pass before, without names.
    progress : callable, optional
        Called with the number of finished frames of the capture.
    """
    recipe = dataclasses.replace(found.recipe, passes=found.recipe.passes + 1)
    made = method_by_name(recipe.method, **recipe.options)
    model = fit_to_tracks(found.tracks, found.model)
    slow_start, n = with_slow_start(found.tracks), found.tracks.detections.n_frames

    def advance(done: int) -> None:
        if progress is not None:
            progress(done * n // slow_start.n_frames)

    slow = associate(
        made, slow_start, model, seed=recipe.seed, recipe=recipe, score=False,
        progress=advance,
    )  # fmt: skip
    return _stitched(after_slow_start(slow, found.tracks.detections), recipe, model)


def _stitched(tracks: Tracks, recipe: Recipe, model: TrackingModel) -> Uncorrected:
    stitching = stitch(tracks, model) if recipe.stitch else None
    if stitching is not None:
        tracks = dataclasses.replace(stitching.tracks, recipe=tracks.recipe)
    return Uncorrected(tracks=tracks, recipe=recipe, model=model, stitching=stitching)
