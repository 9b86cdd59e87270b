"""Attempts at a capture: by a method, and in further ways while identities are uncertain.

The sum of the identity confidences is the number of detections whose identity is expected to be
right. It decides between the attempts.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.own_distances import assigned_again, refined_by_own_distances
from asterism.tracking.attempts.slow_start import after_slow_start, with_slow_start
from asterism.tracking.attempts.uncorrected import DOUBTFUL, Uncorrected
from asterism.tracking.choose import without_motion_in_common
from asterism.tracking.estimation import (
    OVER_THREE_FRAMES,
    fit_body_motion,
    fit_to_tracks,
    without_common_motion,
)
from asterism.tracking.methods import GNN, METHODS, TOMHT, Rigidity, method_by_name, options_of
from asterism.tracking.methods.associate import associate
from asterism.tracking.stitching import stitch, tracklet_model

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe, TrackingModel, Tracks
    from asterism.tracking.methods import Method

__all__ = ["carried_out", "most_certain"]

MAX_PASSES = 4
"""Largest number of passes over the capture."""


def carried_out(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Uncorrected:
    """Carry out the association and the stitching of a recipe, and its further attempts.

    Parameters
    ----------
    recipe, detections, method, start, progress
        As for `asterism.tracking.carry_out`.
    """
    make = most_certain if recipe.retry else attempt
    if not recipe.common_motion:
        return make(recipe, detections, method, start=start, progress=progress)
    still = without_common_motion(detections)
    found = make(recipe, still, method, start=start, progress=progress)
    tracks = dataclasses.replace(found.tracks, detections=detections.measured())
    return dataclasses.replace(found, tracks=tracks, still=still)


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


def most_certain(
    recipe: Recipe,
    detections: Detections,
    method: Method[Any] | None = None,
    *,
    start: Tracks | None = None,
    progress: Callable[[int], Any] | None = None,
) -> Uncorrected:
    """Make attempts while identities are uncertain, and return the most certain result.

    The first is by the method of the recipe. The others are by `TOMHT`: with `Rigidity` and the
    motion of `fit_body_motion`, and without, unless bonds are better or the first has some. That
    with bonds must be more certain by `DOUBTFUL`, because it uses distances as the confidence does.
    Then further passes follow (`next_pass`), until one is not more certain. The best is
    `assigned_again`. If it has bonds and identities are still uncertain, so is an attempt with the
    motion in tracks of single frames, and the more certain of both is the result. If that is still
    uncertain, and detections are more probable without the motion that most markers have in common,
    all this is done without it, which must be more certain by `DOUBTFUL`. For `progress`, the first
    method is half of the work, and every other attempt or pass half of what is left.

    Parameters
    ----------
    recipe, detections, method, start, progress
        As for `carry_out`.
    """
    n, n_made = detections.n_frames, -1

    def half_of_rest() -> Callable[[int], None]:
        """Return the progress of the next attempt."""
        nonlocal n_made
        n_made += 1
        whole = 2 ** (n_made + 1)

        def advance(done: int) -> None:
            if progress is not None:
                progress(((whole - 2) * n + done) // whole)

        return advance

    first = attempt(recipe, detections, method, start=start, progress=half_of_rest())
    best = first
    # A recipe by `TOMHT`, or with several passes, is that of a further attempt already.
    is_first = recipe.method != TOMHT.name and recipe.passes == 1
    if best.is_doubtful and is_first:
        bodies = _by_bonds(recipe, detections, OVER_THREE_FRAMES, half_of_rest())
        if bodies is not None:
            best = _more_certain(first, bodies, DOUBTFUL * detections.n_points)
        if best is first and not first.has_bonds:
            best = _more_certain(first, _by(TOMHT(), recipe, detections, half_of_rest()), 0)
        has_bodies = best is bodies
        best = _after_passes(refined_by_own_distances(best), half_of_rest)
        best = assigned_again(_with_reason(best, first))
        if has_bodies and best.is_doubtful:
            bodies = _by_bonds(recipe, detections, GNN(rigid=Rigidity()), half_of_rest())
            assert bodies is not None
            bodies = _with_reason(refined_by_own_distances(bodies), first)
            best = _more_certain(best, assigned_again(bodies), 0)
    else:
        best = assigned_again(refined_by_own_distances(first))
    if best.is_doubtful and is_first and not recipe.common_motion:
        other = _without_motion_in_common(recipe, detections, half_of_rest())
        if other is not None:
            other = _with_reason(other, best)
            best = _more_certain(best, other, DOUBTFUL * detections.n_points)
    if progress is not None:
        progress(n)
    return best


def _after_passes(best: Uncorrected, begin: Callable[[], Callable[[int], Any]]) -> Uncorrected:
    """Pass over the capture again with bonds, while that makes more identities certain."""
    while best.is_doubtful and best.recipe.passes < MAX_PASSES and best.has_bonds:
        again = _more_certain(best, refined_by_own_distances(next_pass(best, begin())), 0)
        if again is best:
            break
        best = again
    return best


def _by(
    method: TOMHT, recipe: Recipe, detections: Detections, progress: Callable[[int], Any]
) -> Uncorrected:
    recipe = dataclasses.replace(recipe, method=method.name, options=options_of(method))
    return attempt(recipe, detections, method, progress=progress)


def _by_bonds(
    recipe: Recipe, detections: Detections, method: Method[Any], progress: Callable[[int], Any]
) -> Uncorrected | None:
    """Track by `TOMHT` with bonds and the motion in tracks of a method; None for random walks."""
    fitted = fit_body_motion(detections, recipe.model, method)
    if fitted is None:
        return None
    bodies = dataclasses.replace(recipe, model=fitted[0])
    return _by(TOMHT(rigid=Rigidity()), bodies, detections, progress)


def _without_motion_in_common(
    recipe: Recipe, detections: Detections, progress: Callable[[int], Any]
) -> Uncorrected | None:
    """Track without the motion that most markers have in common; None if it explains too little."""
    choice = without_motion_in_common(detections, recipe.model)
    # Bodies are still bodies then, and confidence from their distances is comparable.
    if choice is None or choice.estimate is None or not choice.stitch:
        return None
    other = dataclasses.replace(
        recipe, method=choice.method.name, options=options_of(choice.method),
        model=choice.estimate.model, reason=choice.reason, common_motion=True,
    )  # fmt: skip
    found = carried_out(other, detections, progress=progress)
    recipe = dataclasses.replace(found.recipe, reason=choice.reason)
    return dataclasses.replace(found, recipe=recipe)


def _more_certain(before: Uncorrected, other: Uncorrected, margin: float) -> Uncorrected:
    """Return the other result if it is more certain by a number of detections."""
    return other if other.expected_right > before.expected_right + margin else before


def _with_reason(best: Uncorrected, first: Uncorrected) -> Uncorrected:
    """Return the best result with the reason for it, if a further attempt made it."""
    recipe, other = best.recipe, first.recipe
    is_still = recipe.common_motion and not other.common_motion
    if (recipe.options, recipe.label) == (other.options, other.label) and not is_still:
        return best
    share, less = (100 * each.expected_right / len(each.tracks.labels) for each in (best, first))
    reason = (
        f"{recipe.reason}; {share:.1f} % of the detections are expected to have the right "
        f"identity, against {less:.1f} % with {other.label}" + " and this motion" * is_still
    )
    recipe = dataclasses.replace(recipe, reason=reason)
    tracks = dataclasses.replace(best.tracks, recipe=recipe)
    return dataclasses.replace(best, tracks=tracks, recipe=recipe)
