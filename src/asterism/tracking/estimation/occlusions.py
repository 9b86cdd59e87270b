"""How often markers are seen: the gaps in the tracks of a clip, less those where they were lost.

A tracker that loses a marker at a jolt and takes up another one, or the same again, leaves a gap
like that of a marker which was hidden. But the point that it missed is there, near where it was
expected, in no track or in one that begins within the gap; or, seen backwards from the end of the
gap, in one that ends within it. Such gaps say nothing of misses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["Sightings", "count_sightings"]


class Sightings(NamedTuple):
    """How often markers that are there were seen and missed.

    Parameters
    ----------
    hits, misses : int
        Of those that were seen in the frame before.
    rehits, remisses : int
        Of those that were missed there.
    """

    hits: int
    misses: int
    rehits: int
    remisses: int


def count_sightings(tracks: Tracks, reach: float) -> Sightings:
    """Count from each track's first detection to its last.

    Parameters
    ----------
    tracks : Tracks
        Those that were found.
    reach : float
        Metres from where a marker is expected, within which a point that is left over is it.

    Returns
    -------
    Sightings
    """
    d = tracks.detections
    order, offsets = tracks.by_track
    frame = d.frame_of[order]
    is_link = np.diff(tracks.labels[order]) == 0
    missed = (np.diff(frame) - 1) * is_link
    gaps = np.flatnonzero(missed > 0)  # after the detection order[gap]
    first, last = frame[offsets[:-1]], frame[offsets[1:] - 1]
    begins = np.append(first, d.n_frames)[tracks.labels]  # of clutter: as if after the gap's start
    ends = np.append(last, -1)[tracks.labels]
    was_lost = _is_left_over(tracks, order, gaps, begins, +1, reach)
    was_lost |= _is_left_over(tracks, order, gaps + 1, ends, -1, reach)
    real = gaps[~was_lost]
    n_links, n_gaps, n_missed = int(is_link.sum()), len(real), int(missed[real].sum())
    return Sightings(n_links - n_gaps, n_gaps, n_gaps, n_missed - n_gaps)


def _is_left_over(
    tracks: Tracks,
    order: NDArray[np.int64],
    at: NDArray[np.int64],
    limits: NDArray[np.int64],
    way: int,
    reach: float,
) -> NDArray[np.bool_]:
    """Say whether the next point of a track was there though the track has none.

    Parameters
    ----------
    tracks, reach
        As above.
    order : ndarray of int, shape (M,)
        Detections by track.
    at : ndarray of int, shape (G,)
        Where in `order` tracks have a gap.
    limits : ndarray of int, shape (N,)
        Frame in which the track of each detection begins, or seen backwards ends.
    way : {1, -1}
        Forwards from the gap's start, or backwards from its end.
    """
    from scipy.spatial import KDTree

    d = tracks.detections
    free = np.flatnonzero(way * limits > way * (d.frame_of - way))  # where their frame is the next
    if not len(at) or not len(free):
        return np.zeros(len(at), dtype=bool)
    now = order[at]
    before = order[np.clip(at - way, 0, len(order) - 1)]
    t = d.frame_of[now]
    is_steady = (tracks.labels[before] == tracks.labels[now]) & (d.frame_of[before] == t - way)
    step = (d.times[t + way] - d.times[t]) / np.where(
        is_steady, d.times[t] - d.times[d.frame_of[before]], np.inf
    )
    places = d.points[now] + (d.points[now] - d.points[before]) * step[:, None]
    # Frames far apart along an axis of their own, so that one tree does for all.
    apart = 1.0 + 4.0 * reach
    tree: Any = KDTree(np.column_stack([d.points[free], d.frame_of[free] * apart]))
    distance = tree.query(np.column_stack([places, (t + way) * apart]))[0]
    return np.asarray(distance <= reach)
