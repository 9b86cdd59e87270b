"""Attempts at a capture: by a method, and in further ways while identities are uncertain.

The sum of the identity confidences is the number of detections whose identity is expected to be
right. It decides between the attempts.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from asterism.records import record
from asterism.tracking.confidence import assess
from asterism.tracking.methods import METHODS, TOMHT, method_by_name, options_of
from asterism.tracking.methods.associate import associate
from asterism.tracking.naming import learn_marker_set, name_tracks
from asterism.tracking.stitching import stitch, tracklet_model

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.model import Detections, Recipe, TrackingModel, Tracks
    from asterism.tracking.methods import Method
    from asterism.tracking.naming import Naming
    from asterism.tracking.stitching import Stitching

__all__ = [
    "Uncorrected",
    "assessed",
    "attempt",
    "expected_right",
    "most_certain",
    "refined_by_own_distances",
]

DOUBTFUL = 0.002
"""Share of the detections whose identity is expected to be wrong, from which there are further
attempts."""
MAX_ROUNDS = 4
"""Largest number of marker sets that are learnt from the tracks, each from the tracks that the one
before has named."""
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
    carried = recipe if made.name in METHODS else None
    # Stitched tracks have no log posterior.
    tracks = associate(
        made, detections, model, seed=recipe.seed, start=start, recipe=carried,
        score=not recipe.stitch, progress=progress,
    )  # fmt: skip
    stitching = stitch(tracks, model) if recipe.stitch else None
    if stitching is not None:
        tracks = dataclasses.replace(stitching.tracks, recipe=carried)
    return Uncorrected(tracks=tracks, recipe=recipe, model=model, stitching=stitching)


def most_certain(
    first: Uncorrected, detections: Detections, *, progress: Callable[[int], Any] | None = None
) -> Uncorrected:
    """Make further attempts while identities are uncertain, and return the most certain result.

    The first is by `TOMHT`. Then `refined_by_own_distances` follows.

    Parameters
    ----------
    first : Uncorrected
        Result of the method of the recipe.
    detections, progress
        As for `carry_out`.
    """
    best, n_best = first, expected_right(first)
    if _is_doubtful(best, n_best) and first.recipe.method != TOMHT.name:
        other = _by_tomht(first, detections, progress)
        if (n_right := expected_right(other)) > n_best:
            shares = (100 * n / detections.n_points for n in (n_right, n_best))
            best, n_best = _with_reason(other, first.recipe, *shares), n_right
    return refined_by_own_distances(best, n_best)


def assessed(found: Uncorrected, tracks: Tracks) -> Tracks:
    """Return tracks with the confidence of their identities.

    Parameters
    ----------
    found : Uncorrected
        Result from which the tracks come.
    tracks : Tracks
        Its tracks, or its tracks after edits.
    """
    threads = found.recipe.options.get("threads", 1)
    return assess(tracks, found.model, found.stitching, threads=threads)


def expected_right(found: Uncorrected) -> float:
    """Return the number of detections whose identity is expected to be right.

    Parameters
    ----------
    found : Uncorrected
        Result of an attempt.
    """
    confidence = assessed(found, found.tracks).identity_confidence
    assert confidence is not None
    return float(confidence.sum())


def _is_doubtful(found: Uncorrected, n_right: float) -> bool:
    labels = found.tracks.labels
    return int((labels >= 0).sum()) - n_right > DOUBTFUL * len(labels)


def _by_tomht(
    first: Uncorrected, detections: Detections, progress: Callable[[int], Any] | None
) -> Uncorrected:
    method = TOMHT()
    recipe = dataclasses.replace(first.recipe, method=method.name, options=options_of(method))
    return attempt(recipe, detections, method, progress=progress)


def _with_reason(other: Uncorrected, before: Recipe, share: float, less: float) -> Uncorrected:
    """Return a result whose recipe states why it is better than that of another method."""
    reason = (
        f"{before.reason}; {share:.1f} % of the detections are expected to have the right "
        f"identity, against {less:.1f} % with {before.label}"
    )
    recipe = dataclasses.replace(other.recipe, reason=reason)
    tracks = dataclasses.replace(other.tracks, recipe=recipe)
    return dataclasses.replace(other, tracks=tracks, recipe=recipe)


def refined_by_own_distances(found: Uncorrected, n_right: float) -> Uncorrected:
    """Name tracks by marker sets learnt from them, while that makes more identities certain.

    Parts of tracks change to the marker whose distances they keep.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    n_right : float
        Expected number of detections with the right identity.
    """
    tracks = found.tracks
    is_present = tracks.lengths >= PRESENT * tracks.detections.n_frames
    n_cells = tracks.detections.n_frames * tracks.n_tracks
    if int(is_present.sum()) not in MARKERS or n_cells > MAX_CELLS:
        return found
    names = tuple(f"M{k}" if own else None for k, own in enumerate(is_present))
    named, best = dataclasses.replace(tracks, names=names), found
    for n in range(1, MAX_ROUNDS + 1):
        if not _is_doubtful(best, n_right):
            break
        named = name_tracks(named, learn_marker_set(named)).tracks
        unnamed = dataclasses.replace(
            tracks,
            labels=named.labels,
            names=(None,) * named.n_tracks,
            info={**tracks.info, "refinements": n},
        )
        refined = dataclasses.replace(found, tracks=unnamed)
        if (n_refined := expected_right(refined)) <= n_right:
            break
        best, n_right = refined, n_refined
    return best
