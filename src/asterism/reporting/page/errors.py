"""Errors according to the truth: wrong markers, switches, and markers without a label."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.reporting.page.contents import Verdict
from asterism.reporting.page.stretches import stretches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from asterism.model import Tracks
    from asterism.reporting.page.contents import Judgement

    Error = tuple[str, int, int, float, str]

__all__ = ["errors"]


def errors(tracks: Tracks, judgement: Judgement) -> Iterator[Error]:
    """Find the errors of tracks.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the page.
    judgement : Judgement
        Comparison of the tracks with the truth.

    Yields
    ------
    kind, track, frame, size, reason : str, int, int, float, str
        As for a `Finding`; the size is the number of detections, or 1 for each switch.
    """
    yield from _wrong(tracks, judgement)
    yield from _switches(tracks, judgement)
    yield from _missed(tracks, judgement)


def _wrong(tracks: Tracks, judgement: Judgement) -> Iterator[Error]:
    is_right = (judgement.verdicts == Verdict.RIGHT) & (tracks.labels >= 0)
    own = np.full(tracks.n_tracks, -1)
    own[tracks.labels[is_right]] = judgement.markers[is_right]
    members = np.flatnonzero((judgement.verdicts == Verdict.WRONG) & (tracks.labels >= 0))
    for track, group in stretches(tracks, members):
        reason = f"{len(group)} points are of" if len(group) > 1 else "1 point is of"
        reason += f" {_name(judgement, int(judgement.markers[group[0]]))}"
        if own[track] >= 0:
            reason += f"; the track's marker is {_name(judgement, int(own[track]))}"
        frame = int(tracks.detections.frame_of[group[0]])
        yield "wrong marker", track, frame, float(len(group)), reason


def _switches(tracks: Tracks, judgement: Judgement) -> Iterator[Error]:
    """Find the detections at which the track of a marker changes, as in `Evaluation.switches`."""
    names, frame = tracks.display_names, tracks.detections.frame_of
    both = np.flatnonzero((tracks.labels >= 0) & (judgement.markers >= 0))
    both = both[np.argsort(judgement.markers[both], kind="stable")]
    before, after = both[:-1], both[1:]
    is_switch = (judgement.markers[before] == judgement.markers[after]) & (
        tracks.labels[before] != tracks.labels[after]
    )
    for i, j in zip(before[is_switch], after[is_switch], strict=True):
        marker = _name(judgement, int(judgement.markers[i]))
        reason = f"{marker} continues in this track; before, it was in {names[tracks.labels[i]]}"
        yield "switch", int(tracks.labels[j]), int(frame[j]), 1.0, reason


def _missed(tracks: Tracks, judgement: Judgement) -> Iterator[Error]:
    members = np.flatnonzero(judgement.verdicts == Verdict.MISSED)
    frame = tracks.detections.frame_of[members]
    marker = judgement.markers[members]
    for k in np.unique(marker):
        its = np.sort(frame[marker == k])
        for group in np.split(its, np.flatnonzero(np.diff(its) > 2) + 1):
            n = f"{len(group)} frames" if len(group) > 1 else "1 frame"
            reason = f"{_name(judgement, int(k))} has no label in {n}"
            yield "missed", -1, int(group[0]), float(len(group)), reason


def _name(judgement: Judgement, marker: int) -> str:
    return "no marker" if marker < 0 else judgement.names[marker] or f"marker {marker}"
