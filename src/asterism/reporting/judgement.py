"""What the truth says about tracks: point by point, and in scores with what they mean."""

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

    A label is wrong where its detection is of another marker than its track has most often, the
    lowest of several, as for `Evaluation.wrong_percent`.

    Parameters
    ----------
    tracks, truth : Tracks
        What was found and what is so.

    Returns
    -------
    Judgement

    Raises
    ------
    ParameterError
        If they are not of the same capture.
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
        ("IDF1", _number(e.idf1), "The share of right identities, when each marker may have one "
         "track only: 1 is perfect. It balances the two below."),
        ("Switches", f"{e.switches:,}", "How often a marker goes on under another track than "
         "before."),
        ("IDP", _number(e.idp), "Of what was labelled, the share that has the one right track."),
        ("IDR", _number(e.idr), "Of what there was to label, the share that has the one right "
         "track."),
        ("Wrong labels", _percent(e.wrong_percent), "Labelled points that belong to another marker "
         "than their track has most often, or to none."),
        ("Missed", f"{e.missed:,}", "Points of markers that were left without a label."),
        ("Labelled clutter", f"{e.false_labels:,}", "Points of no marker that were given a label."),
        ("MOTA", _number(e.mota), "1 minus missed points, labelled clutter and switches, as a "
         "share of all points of markers."),
        ("HOTA", _number(e.hota), "Finding points and keeping identities in one number, each "
         "counting alike: 1 is perfect."),
        ("Fragments", f"{e.fragments:,}", "How often a marker loses its label and gets one back "
         "while it is seen all the time."),
        ("Tracks a marker", _number(e.tracks_per_marker), "How many pieces a marker is in, on "
         "average: 1 is perfect."),
    )  # fmt: skip
    return tuple(Score(name=name, value=value, sentence=text) for name, value, text in rows)


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3f} %"
