"""The best that any tracker with a limit can do: the measure beside which a result is read."""

from __future__ import annotations

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.metrics.alignment import marker_labels
from asterism.metrics.counts import successions
from asterism.model import Tracks

__all__ = ["oracle_tracks"]


def oracle_tracks(truth: Tracks, max_gap: int) -> Tracks:
    """Break the truth where a marker was not seen for long.

    A tracker that bridges at most `max_gap` frames cannot know that what comes back after a longer
    gap is the same marker, nor make a track of a single detection.

    Parameters
    ----------
    truth : Tracks
        Who is whom; tracks without a name are clutter if any has a name, as in `evaluate`.
    max_gap : int
        Consecutive detections of a track are at most so many frames apart.

    Returns
    -------
    Tracks
        The pieces, without names; those of a single detection are clutter.

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
    # A piece starts where something follows but nothing precedes; successors come in the order of
    # their tracks and times, so counting the starts before each numbers the pieces.
    has_before = np.zeros(len(truth.labels), dtype=bool)
    has_before[after] = True
    piece = np.cumsum(~has_before[before]) - 1
    labels = np.full(len(truth.labels), -1)
    labels[before] = piece
    labels[after] = piece
    return Tracks(detections=truth.detections, labels=labels)
