"""Labels of a result changed by the distances that its tracks keep to each other."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism._engine import ExchangeEvidence
from asterism.metrics import oracle_tracks
from asterism.tracking.attempts.in_gaps import with_detections_in_gaps
from asterism.tracking.attempts.lost import with_lost_markers
from asterism.tracking.attempts.moved_tracklets import with_moved_tracklets
from asterism.tracking.attempts.posterior import gain_of_change
from asterism.tracking.attempts.shared_search import searched_with_shared_accelerations
from asterism.tracking.confidence.identity import OTHER_JOIN
from asterism.tracking.confidence.reassign import ghost_log_odds, reassigned
from asterism.tracking.naming import learn_marker_set, name_tracks
from asterism.tracking.rigidity import learn_shared_acceleration
from asterism.tracking.stitching import stitch
from asterism.tracking.stitching.exchanged import exchanged_back, with_markers

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.model import Tracks
    from asterism.tracking.attempts.uncorrected import Uncorrected
    from asterism.tracking.stitching.exchanged import Accepts

__all__ = [
    "assigned_again",
    "changed_if_more_probable",
    "exchanged_by_spreads",
    "has_own_distances",
    "refined_by_own_distances",
    "searched_again",
]

MAX_ROUNDS = 4
"""Largest number of times that labels are changed by distances learnt from the tracks, each time
from those of the time before."""
MAX_CELLS = 30_000_000
"""Largest product of frames and tracks; positions of so many take 0.7 GB."""
PRESENT = 0.3
"""Smallest share of the frames in which a marker of such a set is detected."""
MARKERS = range(4, 201)
"""Number of markers of such a set. With fewer, distances are ambiguous; the time of naming grows
with the square of the number."""

EXCHANGE = 30.0
"""Log odds by the posterior with shared accelerations from which tracks are exchanged."""


def refined_by_own_distances(found: Uncorrected) -> Uncorrected:
    """Name tracks by marker sets learnt from them, while that makes more identities certain.

    Parts of tracks change to the marker whose distances they keep.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    """
    tracks = found.tracks
    if not has_own_distances(found):
        return found
    is_present = _is_present(tracks)
    names = tuple(f"M{k}" if own else None for k, own in enumerate(is_present))
    named, best = dataclasses.replace(tracks, names=names), found
    for n in range(1, MAX_ROUNDS + 1):
        if not best.is_doubtful or not any(named.names):
            break
        named = name_tracks(named, learn_marker_set(named)).tracks
        renamed = _with_labels(found, named.labels, n)
        if renamed.expected_right <= best.expected_right:
            break
        best = renamed
    return best


def has_own_distances(found: Uncorrected) -> bool:
    """Return whether a marker set can be learnt from tracks by itself.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    """
    tracks = found.tracks
    is_small = tracks.detections.n_frames * tracks.n_tracks <= MAX_CELLS
    return is_small and int(_is_present(tracks).sum()) in MARKERS


def _is_present(tracks: Tracks) -> NDArray[np.bool_]:
    return tracks.lengths >= PRESENT * tracks.detections.n_frames


def assigned_again(found: Uncorrected) -> Uncorrected:
    """Assign all detections once more by the distances that tracks keep, and what follows from it.

    Then tracks take detections in their gaps and those of lost markers, and tracks that have each
    other's marker are exchanged back (`exchanged_by_spreads`). Where the method has bonds, all of
    that is repeated with the tracks stitched again, while it makes more identities certain. Where
    bonds do not make the identities of a capture more certain, its distances vary too much.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names, `refined_by_own_distances`.
    """
    best, is_stitched_again = found, False
    for n in range(MAX_ROUNDS):
        begun = best if n == 0 else _stitched_again(best)
        again = _with_lost_markers(_with_detections_in_gaps(_reassigned(begun)))
        again = exchanged_by_spreads(again)
        if n > 0 and again.expected_right <= best.expected_right:
            break
        best, is_stitched_again = again, n > 0
        if not best.is_doubtful or not best.has_bonds:
            break
    if best.stitching is None or not is_stitched_again:
        return best
    # What moved since the first stitching is a join, also where it was stitched again.
    n_refined = int(best.tracks.info.get("refinements", 0))
    whole = dataclasses.replace(best, stitching=found.stitching)
    return _with_labels(whole, best.tracks.labels, n_refined)


def _stitched_again(found: Uncorrected) -> Uncorrected:
    """Stitch the pieces of tracks between gaps that the model excludes, and keep the labels.

    A method with bonds follows a marker through longer gaps, where it may have lost it. As joins
    of pieces they are uncertain.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    """
    tracks, model = found.tracks, found.model
    if found.stitching is None:
        return found
    pieces = oracle_tracks(tracks, model.population.max_gap)
    pieces = dataclasses.replace(pieces, info=tracks.info, recipe=tracks.recipe)
    again = dataclasses.replace(found, tracks=tracks, stitching=stitch(pieces, model))
    return _with_labels(again, tracks.labels, int(tracks.info.get("refinements", 0)))


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


def _with_detections_in_gaps(found: Uncorrected) -> Uncorrected:
    if found.stitching is None:
        return found
    stitching = with_detections_in_gaps(found.stitching, found.model)
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


def searched_again(found: Uncorrected, progress: Callable[[int], Any] | None) -> Uncorrected:
    """Search with the shared accelerations of the tracks, and assign all detections once more.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names, `assigned_again`.
    progress : callable, optional
        Called with the number of finished frames of the search.
    """
    labels = searched_with_shared_accelerations(
        found.tracks, found.model, seed=found.recipe.seed,
        threads=found.recipe.options.get("threads", 1), progress=progress,
    )  # fmt: skip
    n_refined = int(found.tracks.info.get("refinements", 0))
    # `refined_by_own_distances` would lose more identities than it mends here.
    return assigned_again(_with_labels(found, labels, n_refined))


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
    return _exchanged(found, ExchangeEvidence.spreads) if found.is_doubtful else found


def changed_if_more_probable(
    found: Uncorrected, progress: Callable[[int], Any] | None = None
) -> Uncorrected:
    """Exchange tracks back and move tracklets by the log posterior, if identities are in doubt.

    The motion at the edges of an exchange must favour it together with the distances, and the log
    posterior with shared accelerations must rise by `EXCHANGE`. Then tracklets of other markers
    leave their tracks (`with_moved_tracklets`). This is for tracks that no attempt follows: the
    confidence hardly sees such an exchange, so that it could not compare them.

    Parameters
    ----------
    found : Uncorrected
        Tracks without names.
    progress : callable, optional
        Called with the number of finished frames of the capture.
    """
    if not found.is_doubtful or not has_own_distances(found):
        return found
    model = found.model
    shared = learn_shared_acceleration(found.tracks, model)

    def accepts(
        before: NDArray[np.int64], after: NDArray[np.int64], changed: NDArray[np.int64]
    ) -> bool:
        return gain_of_change(changed, before, after, found.tracks, model, shared) > EXCHANGE

    exchanged = _exchanged(found, ExchangeEvidence.motion, accepts)
    if exchanged is not found:
        shared = learn_shared_acceleration(exchanged.tracks, model)
    return _changed(exchanged, with_moved_tracklets(exchanged.tracks, model, shared, progress))


def _exchanged(
    found: Uncorrected, evidence: ExchangeEvidence, accepts: Accepts | None = None
) -> Uncorrected:
    tracks = found.tracks
    if found.stitching is None:
        return found
    labels, _ = exchanged_back(tracks.detections, tracks.labels, found.model, evidence, accepts)
    return _changed(found, labels)


def _changed(found: Uncorrected, labels: NDArray[np.int64]) -> Uncorrected:
    """Return a result with other labels, or itself if they are the same."""
    if np.array_equal(labels, found.tracks.labels):
        return found
    return _with_labels(found, labels, int(found.tracks.info.get("refinements", 0)))


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
