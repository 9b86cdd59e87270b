"""Attempts at a capture: by a method, and in further ways while identities are uncertain.

The sum of the identity confidences is the number of detections whose identity is expected to be
right. It decides between the attempts.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.records import record
from asterism.tracking.confidence.identity import (
    OTHER_JOIN,
    Examined,
    examine,
    expected_right,
    with_confidence,
)
from asterism.tracking.confidence.reassign import ghost_log_odds, reassigned
from asterism.tracking.estimation import OVER_THREE_FRAMES, fit_body_motion, fit_to_tracks
from asterism.tracking.lone import with_lone_detections
from asterism.tracking.lost import with_lost_markers
from asterism.tracking.methods import GNN, METHODS, TOMHT, Rigidity, method_by_name, options_of
from asterism.tracking.methods.associate import associate
from asterism.tracking.naming import learn_marker_set, name_tracks
from asterism.tracking.slow_start import after_slow_start, with_slow_start
from asterism.tracking.stitching import stitch, tracklet_model
from asterism.tracking.stitching.exchanged import exchanged_back, with_markers

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.model import Detections, Recipe, TrackingModel, Tracks
    from asterism.tracking.methods import Method
    from asterism.tracking.naming import Naming
    from asterism.tracking.stitching import Stitching

__all__ = [
    "Uncorrected",
    "attempt",
    "exchanged_by_spreads",
    "most_certain",
    "refined_by_own_distances",
]

DOUBTFUL = 0.002
"""Share of the detections whose identity is expected to be wrong, from which there are further
attempts."""
MAX_PASSES = 4
"""Largest number of passes over the capture."""
MAX_ROUNDS = 4
"""Largest number of times that labels are changed by distances learnt from the tracks, each time
from those of the time before."""
PRESENT = 0.3
"""Smallest share of the frames in which a marker of such a set is detected."""
MARKERS = range(4, 201)
"""Number of markers of such a set. With fewer, distances are ambiguous; the time of naming grows
with the square of the number."""
MAX_CELLS = 30_000_000
"""Largest product of frames and tracks for such a set; positions of so many take 0.7 GB."""


@record(eq=False)
class Uncorrected:
    """Tracks of a recipe before any edit, with what the later steps need.

    Parameters
    ----------
    tracks : Tracks
        Associated, stitched and named tracks.
    recipe : Recipe
        Recipe as it was carried out; its method is the one that made the tracks.
    model : TrackingModel
        Model with which they were associated.
    stitching : Stitching, optional
        Stitching that made them.
    naming : Naming, optional
        Names with their probabilities.
    """

    tracks: Tracks
    recipe: Recipe
    model: TrackingModel
    stitching: Stitching | None = None
    naming: Naming | None = None

    @cached_property
    def examined(self) -> Examined:
        """What the confidence of identities is computed from."""
        threads = self.recipe.options.get("threads", 1)
        return examine(self.tracks, self.model, self.stitching, threads=threads)

    @cached_property
    def assessed(self) -> Tracks:
        """The tracks with the confidence of their identities."""
        return with_confidence(self.tracks, self.examined)

    @cached_property
    def expected_right(self) -> float:
        """Number of detections whose identity is expected to be right."""
        return expected_right(self.tracks, self.examined)

    @property
    def is_doubtful(self) -> bool:
        """Whether more than `DOUBTFUL` of the detections are expected to be wrong."""
        labels = self.tracks.labels
        return int((labels >= 0).sum()) - self.expected_right > DOUBTFUL * len(labels)


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
    Then further passes follow (`next_pass`), until one is not more certain. The best is `_settled`.
    If it has bonds and identities are still uncertain, so is an attempt with the motion in tracks
    of single frames, and the more certain of both is the result. For `progress`, the first method
    is half of the work, and every other attempt or pass half of what is left.

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
    if best.is_doubtful and recipe.method != TOMHT.name and recipe.passes == 1:
        bodies = _by_bonds(recipe, detections, OVER_THREE_FRAMES, half_of_rest())
        if bodies is not None:
            best = _more_certain(first, bodies, DOUBTFUL * detections.n_points)
        if best is first and not _has_bonds(recipe):
            best = _more_certain(first, _by(TOMHT(), recipe, detections, half_of_rest()), 0)
        has_bodies = best is bodies
        best = _settled(_after_passes(refined_by_own_distances(best), half_of_rest), first)
        if has_bodies and best.is_doubtful:
            bodies = _by_bonds(recipe, detections, GNN(rigid=Rigidity()), half_of_rest())
            assert bodies is not None
            best = _more_certain(best, _settled(refined_by_own_distances(bodies), first), 0)
    else:
        best = _settled(refined_by_own_distances(first), first)
    if progress is not None:
        progress(n)
    return best


def _settled(found: Uncorrected, first: Uncorrected) -> Uncorrected:
    """Change labels by the distances that tracks keep, and state the reason for the result.

    All detections of tracks with bonds are assigned once more, tracks take lone detections and
    those of lost markers, and tracks that have each other's marker are exchanged back
    (`exchanged_by_spreads`). That is repeated while it makes more identities certain, where the
    method has bonds. Where bonds do not make the identities of a capture more certain, its
    distances vary too much.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names, `refined_by_own_distances`.
    first : Uncorrected
        Result of the first attempt.
    """
    best = _with_reason(found, first)
    for n in range(MAX_ROUNDS):
        again = _with_lost_markers(_with_lone_detections(_reassigned(best)))
        again = exchanged_by_spreads(again)
        if n > 0 and again.expected_right <= best.expected_right:
            break
        best = again
        if not best.is_doubtful or not _has_bonds(best.recipe):
            break
    return best


def _after_passes(best: Uncorrected, begin: Callable[[], Callable[[int], Any]]) -> Uncorrected:
    """Pass over the capture again with bonds, while that makes more identities certain."""
    while best.is_doubtful and best.recipe.passes < MAX_PASSES and _has_bonds(best.recipe):
        again = _more_certain(best, refined_by_own_distances(next_pass(best, begin())), 0)
        if again is best:
            break
        best = again
    return best


def _has_bonds(recipe: Recipe) -> bool:
    return recipe.options.get("rigid") is not None


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


def _more_certain(before: Uncorrected, other: Uncorrected, margin: float) -> Uncorrected:
    """Return the other result if it is more certain by a number of detections."""
    return other if other.expected_right > before.expected_right + margin else before


def _with_lone_detections(found: Uncorrected) -> Uncorrected:
    if found.stitching is None:
        return found
    stitching = with_lone_detections(found.stitching, found.model)
    tracks = dataclasses.replace(stitching.tracks, recipe=found.tracks.recipe)
    return dataclasses.replace(found, tracks=tracks, stitching=stitching)


def _with_lost_markers(found: Uncorrected) -> Uncorrected:
    """Find markers by their distances where tracks have lost them, if identities are in doubt."""
    tracks = found.tracks
    if not found.is_doubtful:
        return found
    noise_sigma = found.model.sensor.noise_sigma
    labels = with_lost_markers(tracks.detections, tracks.labels, noise_sigma)
    return _with_labels(found, labels, int(tracks.info.get("refinements", 0)))


def _with_reason(best: Uncorrected, first: Uncorrected) -> Uncorrected:
    """Return the best result with the reason for it, if a further attempt made it."""
    recipe, other = best.recipe, first.recipe
    if (recipe.options, recipe.label) == (other.options, other.label):
        return best
    share, less = (100 * each.expected_right / len(each.tracks.labels) for each in (best, first))
    reason = (
        f"{other.reason}; {share:.1f} % of the detections are expected to have the right "
        f"identity, against {less:.1f} % with {other.label}"
    )
    recipe = dataclasses.replace(recipe, reason=reason)
    tracks = dataclasses.replace(best.tracks, recipe=recipe)
    return dataclasses.replace(best, tracks=tracks, recipe=recipe)


def _reassigned(found: Uncorrected) -> Uncorrected:
    """Assign all detections once more, while that makes more identities certain.

    The confidence uses the same distances, so that it is too high afterwards to compare the result
    with one that was not assigned once more.
    """
    best = found
    for _ in range(MAX_ROUNDS):
        if not best.is_doubtful:
            break
        tracks = best.tracks
        labels = reassigned(
            tracks, np.ones(len(tracks.labels), dtype=bool), ghost_log_odds(tracks, best.stitching),
            best.model.sensor.noise_sigma,
        )  # fmt: skip
        again = _with_labels(best, labels, int(tracks.info.get("refinements", 0)) + 1)
        if again.expected_right <= best.expected_right:
            break
        best = again
    return best


def refined_by_own_distances(found: Uncorrected) -> Uncorrected:
    """Name tracks by marker sets learnt from them, while that makes more identities certain.

    Parts of tracks change to the marker whose distances they keep.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    """
    tracks = found.tracks
    is_present = tracks.lengths >= PRESENT * tracks.detections.n_frames
    n_cells = tracks.detections.n_frames * tracks.n_tracks
    if int(is_present.sum()) not in MARKERS or n_cells > MAX_CELLS:
        return found
    names = tuple(f"M{k}" if own else None for k, own in enumerate(is_present))
    named, best = dataclasses.replace(tracks, names=names), found
    for n in range(1, MAX_ROUNDS + 1):
        if not best.is_doubtful:
            break
        named = name_tracks(named, learn_marker_set(named)).tracks
        renamed = _with_labels(found, named.labels, n)
        if renamed.expected_right <= best.expected_right:
            break
        best = renamed
    return best


def exchanged_by_spreads(found: Uncorrected) -> Uncorrected:
    """Exchange tracks back that have each other's marker, if identities are in doubt.

    That includes pairs whose distances to others have the same medians and different spreads. The
    confidence does not see such an exchange, because it learns the distances of both tracks from
    all of their detections, the exchanged ones included.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    """
    tracks = found.tracks
    if found.stitching is None or not found.is_doubtful:
        return found
    labels, _ = exchanged_back(tracks.detections, tracks.labels, found.model, by_spreads=True)
    if np.array_equal(labels, tracks.labels):
        return found
    return _with_labels(found, labels, int(tracks.info.get("refinements", 0)))


def _with_labels(found: Uncorrected, labels: NDArray[np.int64], n: int) -> Uncorrected:
    """Return a result with other labels; the parts that moved are joins there."""
    info, stitching = {**found.tracks.info, "refinements": n}, found.stitching
    if stitching is not None:
        stitching = with_markers(stitching, labels, np.full(len(labels), OTHER_JOIN))
        info["joins"] = len(stitching.joins)
    tracks = dataclasses.replace(found.tracks, labels=labels, names=(), info=info)
    if stitching is not None:
        stitching = dataclasses.replace(stitching, tracks=tracks)
    return dataclasses.replace(found, tracks=tracks, stitching=stitching)
