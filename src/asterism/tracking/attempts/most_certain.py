"""Attempts at a capture: by a method, and in further ways while identities are uncertain.

The sum of the identity confidences is the number of detections whose identity is expected to be
right. It decides between the attempts.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.tracking.attempts.agreed import until_agreed
from asterism.tracking.attempts.attempt import attempt, next_pass
from asterism.tracking.attempts.halves import Halves
from asterism.tracking.attempts.own_distances import (
    assigned_again,
    changed_if_more_probable,
    has_own_distances,
    refined_by_own_distances,
    searched_again,
)
from asterism.tracking.attempts.uncorrected import DOUBTFUL, Uncorrected
from asterism.tracking.estimation import (
    OVER_THREE_FRAMES,
    fit_body_motion,
    without_common_motion,
)
from asterism.tracking.methods import GNN, MCMCDA, SMP, TOMHT, Rigidity, options_of
from asterism.tracking.motion_in_common import choice_without_common_motion

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe, Tracks
    from asterism.tracking.methods import Method

__all__ = ["carried_out", "most_certain"]

MAX_PASSES = 4
"""Largest number of passes over the capture."""
MAX_SEARCHES = 2
"""Largest number of searches with shared accelerations."""


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
        As for `asterism.tracking.carry_out`. A recipe with further attempts has a method of
        `METHODS` and no initial tracks.
    """
    still = without_common_motion(detections) if recipe.common_motion else None
    tracked = detections if still is None else still
    if not recipe.retry:
        found = attempt(recipe, tracked, method, start=start, progress=progress)
    elif recipe.method == MCMCDA.name and not recipe.stitch:
        found = until_agreed(recipe, tracked, progress)
    else:
        found = most_certain(recipe, tracked, progress)
    if still is None:
        return found
    tracks = dataclasses.replace(found.tracks, detections=detections.measured())
    return dataclasses.replace(found, tracks=tracks, still=still)


def most_certain(
    recipe: Recipe, detections: Detections, progress: Callable[[int], Any] | None = None
) -> Uncorrected:
    """Make attempts while identities are uncertain, and return the most certain result.

    The first is by the method of the recipe. The others are by `TOMHT`: with `Rigidity` and the
    motion of `fit_body_motion`, and without, unless bonds are better or the first has some. That
    with bonds must be more certain by `DOUBTFUL`, because it uses distances as the confidence does.
    Then further passes follow (`next_pass`), until one is not more certain. The best is
    `assigned_again`. If it has bonds and identities are still uncertain, so is an attempt with the
    motion in tracks of single frames, and the more certain of both is the result. While identities
    are uncertain, `searched_again` follows, and then `changed_if_more_probable`. If they still are
    uncertain, and detections are more probable without the motion that most markers have in common,
    all this is done without it, which must be more certain by `DOUBTFUL`. For `progress`, the first
    method is half of the work, and every other attempt, pass or search half of what is left.

    Parameters
    ----------
    recipe, detections, progress
        As for `carry_out`; the method is built from the recipe.
    """
    parts = Halves(detections.n_frames, progress)
    margin = DOUBTFUL * detections.n_points
    first = attempt(recipe, detections, progress=parts.next())
    best = first
    # A recipe by another method, or with several passes, is that of a further attempt already.
    is_first = recipe.method == SMP.name and recipe.passes == 1
    if best.is_doubtful and is_first:
        bodies = _by_bonds(recipe, detections, OVER_THREE_FRAMES, parts.next())
        if bodies is not None:
            best = _more_certain(first, bodies, margin)
        if best is first and not first.has_bonds:
            best = _more_certain(first, _by(TOMHT(), recipe, detections, parts.next()), 0)
        has_bodies = best is bodies
        best = _after_passes(refined_by_own_distances(best), parts.next)
        best = assigned_again(_with_reason(best, first))
        if has_bodies and best.is_doubtful:
            bodies = _by_bonds(recipe, detections, GNN(rigid=Rigidity()), parts.next())
            assert bodies is not None
            bodies = _with_reason(refined_by_own_distances(bodies), first)
            best = _more_certain(best, assigned_again(bodies), 0)
    else:
        best = assigned_again(refined_by_own_distances(first))
    best = changed_if_more_probable(_after_searches(best, parts.next), parts.next())
    if best.is_doubtful and is_first and not recipe.common_motion:
        still = _attempt_without_common_motion(recipe, detections, parts.next())
        if still is not None:
            best = _more_certain(best, _with_reason(still, best), margin)
    parts.end()
    return best


def _after_passes(best: Uncorrected, begin: Callable[[], Callable[[int], Any]]) -> Uncorrected:
    """Pass over the capture again with bonds, while that makes more identities certain."""
    while best.is_doubtful and best.recipe.passes < MAX_PASSES and best.has_bonds:
        again = _more_certain(best, refined_by_own_distances(next_pass(best, begin())), 0)
        if again is best:
            break
        best = again
    return best


def _after_searches(best: Uncorrected, begin: Callable[[], Callable[[int], Any]]) -> Uncorrected:
    """Search with shared accelerations, while more identities become certain.

    A search also takes detections into tracks. More of all must be expected to be right, and by a
    larger number than more are expected to be wrong.
    """
    n = 0
    while best.is_doubtful and n < MAX_SEARCHES and has_own_distances(best):
        again = searched_again(best, begin())
        more_right = again.expected_right - best.expected_right
        if more_right <= max(again.expected_wrong - best.expected_wrong, 0):
            break
        best, n = again, n + 1
    if n == 0:
        return best
    tracks = dataclasses.replace(best.tracks, info={**best.tracks.info, "searches": n})
    return dataclasses.replace(best, tracks=tracks)


def _by(
    method: Method[Any], recipe: Recipe, detections: Detections, progress: Callable[[int], Any]
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


def _attempt_without_common_motion(
    recipe: Recipe, detections: Detections, progress: Callable[[int], Any]
) -> Uncorrected | None:
    """Track without the motion that most markers have in common.

    None if this motion explains too little, or if there are no bodies without it.
    """
    choice = choice_without_common_motion(detections, recipe.model)
    # Bodies are still bodies then, and confidence from their distances is comparable.
    if choice is None or not choice.stitch:
        return None
    assert choice.estimate is not None
    other = dataclasses.replace(
        recipe, method=choice.method.name, options=options_of(choice.method),
        model=choice.estimate.model, reason=choice.reason, common_motion=True,
    )  # fmt: skip
    found = carried_out(other, detections, progress=progress)
    # One comparison is stated: that with the result in this motion.
    recipe = dataclasses.replace(found.recipe, reason=choice.reason)
    return dataclasses.replace(found, recipe=recipe, estimate=choice.estimate)


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
    by = "with this motion, by" if is_still else "with"
    reason = (
        f"{recipe.reason}; {share:.1f} % of the detections are expected to have the right "
        f"identity, against {less:.1f} % {by} {other.label}"
    )
    recipe = dataclasses.replace(recipe, reason=reason)
    tracks = dataclasses.replace(best.tracks, recipe=recipe)
    return dataclasses.replace(best, tracks=tracks, recipe=recipe)
