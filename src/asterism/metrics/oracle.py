"""Oracle: the true partition, broken at long gaps, as an upper bound of a tracker's scores."""

from __future__ import annotations

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.metrics.alignment import marker_labels
from asterism.metrics.counts import successions
from asterism.model import Tracks

__all__ = ["oracle_tracks"]


def oracle_tracks(truth: Tracks, max_gap: int) -> Tracks:
    """Break the tracks of the truth at gaps longer than a tracker can bridge.

    A tracker that links detections over at most `max_gap` frames cannot identify a marker after a
    longer gap, and cannot make a track of a single detection. The scores of the result are an
    upper bound for such a tracker.

    Parameters
    ----------
    truth : Tracks
        Ground truth. If any track has a name, the unnamed ones are clutter, as in `evaluate`.
    max_gap : int
        Largest number of frames between consecutive detections of a track, ≥ 1.

    Returns
    -------
    Tracks
        Tracklets without names. Single detections are clutter.

    Raises
    ------
    ParameterError
        If `max_gap` is not a whole number ≥ 1.

    Examples
    --------
    >>> import numpy as np
    >>> truth = Tracks.from_dense([0, 1, 2, 3, 4], np.ones((5, 1, 3)) * [[[1]], [[1]], [[np.nan]],
    ...                                                                 [[1]], [[1]]])
    >>> oracle_tracks(truth, max_gap=1).labels, oracle_tracks(truth, max_gap=2).labels
    (array([0, 0, 1, 1]), array([0, 0, 0, 0]))
    """
    check_number("max_gap", max_gap, above=1, closed=True, integer=True)
    check_kind("truth", truth, Tracks)
    frame_of = truth.detections.frame_of
    before, after = successions(marker_labels(truth))
    is_short = frame_of[after] - frame_of[before] <= max_gap
    before, after = before[is_short], after[is_short]
    # A tracklet starts at a detection with a successor but no predecessor. Successors are ordered
    # by track and time, so the number of starts before each numbers the tracklets.
    has_before = np.zeros(len(truth.labels), dtype=bool)
    has_before[after] = True
    piece = np.cumsum(~has_before[before]) - 1
    labels = np.full(len(truth.labels), -1)
    labels[before] = piece
    labels[after] = piece
    return Tracks(detections=truth.detections, labels=labels)
