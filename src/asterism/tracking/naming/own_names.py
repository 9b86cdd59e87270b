"""Names that a capture has itself, as evidence for the names of its tracks."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.io.captures.marker_names import is_unlabelled
from asterism.model import Capture
from asterism.tracking.naming.learn import learn_marker_set

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, MarkerSet, Tracks

__all__ = ["has_own_names", "own_log_odds", "own_marker_set", "own_tracks"]

LABELLED = 16.0
"""Log odds of a name by the labels of the capture, in each window. It is more than the bonus for
the name that a track has had: where distances do not tell, the names are kept."""


def has_own_names(detections: Detections) -> bool:
    """Return whether a capture has names."""
    return isinstance(detections, Capture) and _named(detections.tracks) is not None


def own_tracks(tracks: Tracks) -> Tracks | None:
    """Return the named tracks of a capture: the given ones, or those of its file; None for none."""
    found = _named(tracks)
    if found is None and isinstance(tracks.detections, Capture):
        found = _named(tracks.detections.tracks)
    return found


def _named(tracks: Tracks) -> Tracks | None:
    """Return the tracks without placeholders for names, and without names that occur twice."""
    n = Counter(tracks.names)
    names = [
        name if name and n[name] == 1 and not is_unlabelled(name) and length else None
        for name, length in zip(tracks.names, tracks.lengths, strict=True)
    ]
    return replace(tracks, names=tuple(names)) if any(names) else None


def own_marker_set(tracks: Tracks) -> MarkerSet:
    """Learn the marker set of all subjects of a capture from its own names, which it keeps."""
    tracks = tracks.measured()
    names = [name for name, n in zip(tracks.names, tracks.lengths, strict=True) if name and n]
    return replace(learn_marker_set(tracks), names=tuple(names), subject="")


def own_log_odds(
    labels: NDArray[np.int64], n_tracks: int, markers: NDArray[np.int64], n_markers: int
) -> NDArray[np.float64]:
    """Return the log odds of each marker for each track by the names of the capture, (K, M).

    Parameters
    ----------
    labels : ndarray of int, shape (N,)
        Track of each detection, -1 for none.
    n_tracks : int
        Number of tracks K.
    markers : ndarray of int, shape (N,)
        Marker of each detection in the capture, -1 for none.
    n_markers : int
        Number of markers M.
    """
    used = (labels >= 0) & (markers >= 0)
    counts = np.zeros((n_tracks, n_markers))
    np.add.at(counts, (labels[used], markers[used]), 1)
    return LABELLED * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
