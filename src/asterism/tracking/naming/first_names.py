"""First names: those of the tracks of one moment, for the subjects in a capture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.naming.bodies import bodies_of_sets, linked_bodies, parted_bodies
from asterism.tracking.naming.positions import positions_in
from asterism.tracking.naming.search import Found, search

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import MarkerSet, Tracks
    from asterism.model.upwards import Axis

__all__ = ["First", "first_names", "first_own_names"]

MIN_LENGTH = 5
"""Smallest number of detections of a track that is named first."""
LONG = 60
"""Number of detections above which a longer track is no better."""
FIRST_FRAMES = 100
"""Number of frames in which the first tracks are compared."""
MIN_MEAN = 0.7
"""Smallest mean log odds of the distances between named tracks, for a marker set to fit."""
MIN_FIT, MIN_ROUGH_FIT, ROUGH = 0.75, 0.6, 0.015
"""Smallest score for a marker set to fit, as a share of the score of tracks at exactly its
distances; and that for a rough set, whose near distances vary more than `ROUGH`, metres, between
subjects. On real captures of whole bodies, sets of other protocols reach 0.6 to 0.75; sets of other
subjects 0.88, subject templates 0.76, and labelling templates, which are rough, 0.64 and more."""
NEAR = 0.3
"""Largest of these near distances, metres."""
SIZES = (0.6, 1.6)
"""Smallest and largest size of a subject relative to the set."""
MIN_SHARE, MIN_FOUND = 0.5, 0.4
"""Smallest share of the tracks, or of the markers if these are fewer, that a set must name, and
smallest share of its markers that must be there."""


@dataclass(frozen=True, eq=False, kw_only=True)
class First:
    """First names of one subject."""

    frame: int
    tracks: NDArray[np.int64]  # of the body, shape (n,)
    found: Found
    probability: float  # that the body is this subject's, not another's of the given sets


def first_names(tracks: Tracks, marker_sets: tuple[MarkerSet, ...], up: Axis) -> list[First | None]:
    """Name the tracks of the frame with the most long tracks; each set names a body of its own.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    marker_sets : tuple of MarkerSet
        Set of each subject.
    up : {"x", "y", "z"}
        Axis of the capture that points up.

    Returns
    -------
    list of First or None
        Names by each set; None where it does not fit.
    """
    none: list[First | None] = [None] * len(marker_sets)
    frame, alive = _fullest(tracks, tracks.lengths >= MIN_LENGTH)
    if len(alive) < 2:
        return none
    positions = _positions(tracks, alive)
    n = len(marker_sets)
    if n == 1:
        one = _named_bodies(marker_sets, positions, [np.arange(len(alive))], up)
    else:
        one = _named_bodies(marker_sets, positions, parted_bodies(positions, n), up)
    if n == 1 and one.score > 0:
        best = one
    else:  # a subject may be absent, and others without a set may be there
        other = _named_bodies(marker_sets, positions, linked_bodies(positions), up)
        best = max(one, other, key=lambda named: named.score)
    return [
        None
        if found is None
        else First(frame=frame, tracks=alive[body], found=found, probability=p)
        for body, found, p in zip(best.bodies, best.found, best.probabilities, strict=True)
    ]


def first_own_names(
    tracks: Tracks, made: MarkerSet, up: Axis, labelled: NDArray[np.float64]
) -> First | None:
    """Name the tracks of the frame with the most long tracks that the capture itself names.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    made : MarkerSet
        Set that was learnt from the names of the capture; it fits.
    up : {"x", "y", "z"}
        Axis of the capture that points up.
    labelled : ndarray of shape (K, M)
        Log odds of each marker for each track by these names.
    """
    is_long = tracks.lengths >= MIN_LENGTH
    frame, alive = _fullest(tracks, is_long & labelled.any(axis=1), is_long)
    if not len(alive):
        return None
    own = labelled[alive]
    start, best = own.argmax(axis=1), own.max(axis=1)
    start[best == 0] = -1
    for m in np.unique(start[start >= 0]):  # one track a marker, the one that has most of its name
        rivals = np.flatnonzero(start == m)
        start[np.delete(rivals, best[rivals].argmax())] = -1
    found = search(made, _positions(tracks, alive), up, start=start, labelled=own)
    assert found is not None
    return First(frame=frame, tracks=alive, found=found, probability=1.0)


def _fullest(
    tracks: Tracks, counts: NDArray[np.bool_], is_used: NDArray[np.bool_] | None = None
) -> tuple[int, NDArray[np.int64]]:
    """Return the frame with the most long tracks of those that count, and its used tracks."""
    d = tracks.detections
    used = np.flatnonzero(tracks.labels >= 0)
    worth = np.where(counts, np.minimum(tracks.lengths, LONG), 0)
    by_frame = np.bincount(
        d.frame_of[used], weights=worth[tracks.labels[used]], minlength=d.n_frames
    )
    frame = int(np.argmax(by_frame)) if len(by_frame) else 0
    alive = tracks.labels[slice(*d.offsets[[frame, frame + 1]])] if len(used) else used
    alive = np.unique(alive[alive >= 0])
    return frame, alive[(counts if is_used is None else is_used)[alive]]


@dataclass(frozen=True, eq=False)
class _Named:
    """Body of each subject with its names, None for none, and the sum of their scores."""

    bodies: list[NDArray[np.int64]]
    found: list[Found | None]
    probabilities: list[float]
    score: float


def _named_bodies(
    marker_sets: tuple[MarkerSet, ...],
    positions: NDArray[np.float64],
    bodies: list[NDArray[np.int64]],
    up: Axis,
) -> _Named:
    """Name bodies by the sets that fit; each set has the body with which all fit best."""
    results: dict[tuple[int, int], Found] = {}
    for s, made in enumerate(marker_sets):
        for b, body in enumerate(bodies):
            if len(body) >= MIN_FOUND * len(made):
                own = search(made, positions[:, body], up)
                if own is not None and _fits(own, made):
                    results[s, b] = own
    scores = {key: own.score for key, own in results.items()}
    chosen, probabilities = bodies_of_sets(scores, len(marker_sets), len(bodies))
    found = [results.get((s, b)) for s, b in enumerate(chosen)]
    empty = np.empty(0, dtype=np.int64)
    return _Named(
        [bodies[b] if b >= 0 else empty for b in chosen],
        found,
        probabilities,
        sum(own.score for own in found if own is not None),
    )


def _fits(found: Found, made: MarkerSet) -> bool:
    n_named, n_markers = int((found.names >= 0).sum()), found.evidence.n_markers
    expected = max(MIN_SHARE * min(len(found.names), n_markers), MIN_FOUND * n_markers)
    variation = made.variations[(made.distances > 0) & (made.distances < NEAR)]
    is_rough = np.median(np.nan_to_num(variation)) > ROUGH if len(variation) else False
    is_close = found.mean_log_odds >= MIN_MEAN
    is_close &= found.fit >= (MIN_ROUGH_FIT if is_rough else MIN_FIT)
    return n_named >= max(expected, 1) and is_close and SIZES[0] < found.size < SIZES[1]


def _positions(tracks: Tracks, alive: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return positions of some tracks in frames in which most of them exist, (F, n, 3)."""
    d = tracks.detections
    column = np.full(tracks.n_tracks + 1, -1)  # the last element is for clutter
    column[alive] = np.arange(len(alive))
    columns = column[tracks.labels]
    counts = np.bincount(d.frame_of[columns >= 0], minlength=d.n_frames)
    frames = np.flatnonzero(counts >= 0.5 * counts.max())
    frames = frames[np.unique(np.linspace(0, len(frames) - 1, FIRST_FRAMES).astype(np.int64))]
    return positions_in(d, frames, columns, len(alive))
