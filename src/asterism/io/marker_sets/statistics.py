"""Marker sets from segments: distances and heights over sampled postures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.io.marker_sets.postures import neutral, place_markers, postures, relaxed
from asterism.model import MarkerSet
from asterism.model.marker_geometry import heights, pose_distances, sides_of, steady_quads

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.io.marker_sets.postures import Segment

__all__ = ["marker_set"]

ATTACHED = 0.003, 0.01
"""Variation of a distance of a calibrated subject, whose markers may have been attached again:
metres, and share of the distance."""
PRIOR = 0.005, 0.06
"""The same between subjects, where a size is that of the template."""
WIDE = 2.0
"""Factor on the joint angles of the postures in which sides are measured."""
MAX_SEGMENTS = 2
"""Largest number of segments of a marker and its references, for their side to have a spread."""


def marker_set(
    segments: Sequence[Segment],
    *,
    names: Sequence[str],
    owner: NDArray[np.int64],
    local: NDArray[np.float64],
    presences: Sequence[float],
    is_calibrated: bool,
) -> MarkerSet:
    """Return the marker set of a tree of segments.

    Parameters
    ----------
    segments : sequence of Segment
        Segments, each after its parent.
    names : sequence of str
        Names of the M markers.
    owner : ndarray of int, shape (M,)
        Segment of each marker, -1 for none.
    local : ndarray of shape (M, 3)
        Position of each marker in its segment, metres.
    presences : sequence of float
        Presence of each marker.
    is_calibrated : bool
        Whether the sizes are those of a subject rather than of a template.
    """
    segments = relaxed(segments, owner, local)
    places = place_markers(segments, owner, local, neutral(segments))
    moving, faulty, wide = (
        np.stack([place_markers(segments, owner, local, own) for own in sampled])
        for sampled in (
            postures(segments, angle=1),
            postures(segments, error=1),
            postures(segments, angle=WIDE, error=1),
        )
    )
    distances, movements = _distances(moving)
    fixed, share = ATTACHED if is_calibrated else PRIOR
    variations = np.hypot(fixed + share * distances, _distances(faulty)[1])
    for table in (distances, movements, variations):
        np.fill_diagonal(table, 0.0)
    return MarkerSet(
        names=tuple(names),
        places=places,
        distances=distances,
        movements=movements,
        variations=variations,
        segments=tuple(segments[s].name if s >= 0 else None for s in owner),
        presences=np.array(presences),
        **_sides(owner, places, wide, distances, movements, error=(fixed, share)),
    )


def _sides(
    owner: NDArray[np.int64],
    places: NDArray[np.float64],
    wide: NDArray[np.float64],
    distances: NDArray[np.float64],
    movements: NDArray[np.float64],
    *,
    error: tuple[float, float],
) -> dict[str, Any]:
    """Return sides that hold in all postures, with their spread, and those of the neutral one.

    Sides across several joints are left out: real postures differ more than sampled ones.

    The sides of the neutral posture have no known spread, so that they weigh less. They contain
    what no other side does, as which wrist marker is in front.
    """
    quads = steady_quads(distances, movements)
    quads = quads[(np.diff(np.sort(owner[quads], axis=1), axis=1) > 0).sum(axis=1) < MAX_SEGMENTS]
    sampled = heights(wide, quads)
    middle = sampled.mean(axis=0)
    spread = np.hypot(sampled.std(axis=0), error[0] + error[1] * np.abs(middle))
    own = sides_of(quads, middle, spread, distances)
    simple = MarkerSet(names=tuple(map(str, range(len(places)))), places=places)
    return {name: np.concatenate([own[name], getattr(simple, name)]) for name in own}


def _distances(poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and standard deviation of the distances over postures, one posture at a time."""
    first = pose_distances(poses[0])
    total, squares = np.zeros_like(first), np.zeros_like(first)
    for pose in poses:
        off = pose_distances(pose) - first
        total += off
        squares += off**2
    mean = total / len(poses)
    return first + mean, np.sqrt(np.maximum(squares / len(poses) - mean**2, 0.0))
