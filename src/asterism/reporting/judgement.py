"""Comparison of tracks with the truth: a verdict for each point, and explained scores."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asterism.metrics import Evaluation, align, evaluate
from asterism.reporting.page import Judgement, Score, Verdict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.metrics import Alignment
    from asterism.model import Tracks

__all__ = ["judge"]


def judge(tracks: Tracks, truth: Tracks) -> Judgement:
    """Compare tracks with the truth.

    A label is wrong if the marker of its detection differs from the most frequent marker of its
    track (the lowest if several are equally frequent), as for `Evaluation.wrong_percent`.

    Parameters
    ----------
    tracks, truth : Tracks
        Tracks of the page, and the ground truth. A truth with confidence or a recipe is taken for
        another result.

    Returns
    -------
    Judgement
        Verdicts, true markers and scores.

    Raises
    ------
    ParameterError
        If tracks and truth are not of the same capture.
    """
    both = align(tracks, truth)
    verdicts = np.full(tracks.detections.n_points, int(Verdict.RIGHT))
    markers = np.full(tracks.detections.n_points, -1)
    here = both.i_tracks >= 0
    verdicts[both.i_tracks[here]] = _verdicts(both)[here]
    markers[both.i_tracks[here]] = both.truth_labels[here]
    return Judgement(
        verdicts=verdicts,
        markers=markers,
        names=truth.names,
        scores=_scores(evaluate(tracks, truth)),
        n_elsewhere=int(np.count_nonzero(~here & (both.truth_labels >= 0))),
        against="truth" if truth.recipe is None and truth.confidence is None else "other result",
    )


def _verdicts(both: Alignment) -> NDArray[np.int64]:
    track, marker = both.labels, both.truth_labels
    on_both = (track >= 0) & (marker >= 0)
    n_markers = int(marker.max(initial=0)) + 1
    pairs, counts = np.unique(track[on_both] * n_markers + marker[on_both], return_counts=True)
    commonest = np.full(int(track.max(initial=0)) + 1, -2)
    rising = np.lexsort((-pairs, counts))  # the last one written stays
    commonest[pairs[rising] // n_markers] = pairs[rising] % n_markers
    found = np.full(len(track), int(Verdict.RIGHT))
    found[(track < 0) & (marker >= 0)] = Verdict.MISSED
    is_wrong = (track >= 0) & (commonest[np.maximum(track, 0)] != marker)
    found[is_wrong] = Verdict.WRONG
    return found


def _scores(e: Evaluation) -> tuple[Score, ...]:
    rows = (
        ("IDF1", _number(e.idf1), "Harmonic mean of IDP and IDR; 1 is perfect."),
        ("Switches", f"{e.switches:,}", "Number of times that the track of a marker changes."),
        ("IDP", _number(e.idp), "Share of the labelled points that are in the one track matched to "
         "their marker."),
        ("IDR", _number(e.idr), "Share of the points of markers that are in the one track matched "
         "to their marker."),
        ("Wrong labels", _percent(e.wrong_percent), "Share of the labelled points whose marker is "
         "not the most frequent marker of their track."),
        ("Missed", f"{e.missed:,}", "Number of points of markers without a label."),
        ("Labelled clutter", f"{e.false_labels:,}", "Number of clutter points with a label."),
        ("MOTA", _number(e.mota), "1 minus the number of missed points, labelled clutter and "
         "switches, divided by the number of points of markers."),
        ("HOTA", _number(e.hota), "Score with equal weights for detection and association; 1 is "
         "perfect."),
        ("Fragments", f"{e.fragments:,}", "Number of times that a marker loses its label and gets "
         "one again, with unlabelled points between."),
        ("Tracks per marker", _number(e.tracks_per_marker), "Mean number of tracks of a marker; 1 "
         "is perfect."),
    )  # fmt: skip
    return tuple(Score(name=name, value=value, sentence=text) for name, value, text in rows)


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3f} %"
