"""Findings: places at which tracks are most likely wrong, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.model import Capture
from asterism.reporting.page.errors import errors
from asterism.reporting.page.runs import gaps_of
from asterism.reporting.page.strange_steps import StrangeStep, strange_steps
from asterism.reporting.page.stretches import stretches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from asterism.model import Tracks
    from asterism.reporting.page.contents import Judgement
    from asterism.tracking import Naming

__all__ = ["DOUBTFUL", "Finding", "find_troubles"]

DOUBTFUL = 0.9
"""Confidence below which a label is listed."""
LONG = 0.1
"""Shortest long gap, seconds."""
_WEIGHT = {  # what each kind counts beside the others
    "wrong marker": 100.0, "switch": 80.0, "likely swap": 50.0, "changed marker": 30.0,
    "uncertain name": 20.0, "jump": 10.0, "low confidence": 4.0,
    "begun midway": 3.0, "ends early": 2.0, "long gap": 1.0, "missed": 1.0,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Place at which tracks are probably wrong.

    Parameters
    ----------
    kind : str
        Kind, such as ``"likely swap"``.
    track : int
        Track of the finding, -1 for none.
    frame : int
        Frame, counted from 0.
    weight : float
        Severity, by which findings are sorted.
    reason : str
        Reason in words.
    """

    kind: str
    track: int
    frame: int
    weight: float
    reason: str


def find_troubles(
    tracks: Tracks, judgement: Judgement | None = None, naming: Naming | None = None
) -> list[Finding]:
    """Find the places at which tracks are most likely wrong.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the page.
    judgement : Judgement, optional
        Comparison with the truth, whose errors are added.
    naming : Naming, optional
        Result of the naming, whose uncertain names and changes of marker are added.

    Returns
    -------
    list of Finding
        Findings in the order of their weights, the largest first.
    """
    found = [*_doubts(tracks), *_gaps(tracks), *_ends(tracks), *_steps(tracks)]
    if judgement is not None:
        found += [
            _finding(kind, track, frame, size, reason)
            for kind, track, frame, size, reason in errors(tracks, judgement)
        ]
    if naming is not None:
        found += _names(tracks, naming)
    return sorted(found, key=lambda f: (-f.weight, f.frame, f.track))


def _finding(kind: str, track: Any, frame: Any, size: float, reason: str) -> Finding:
    return Finding(
        kind=kind, track=int(track), frame=int(frame), weight=_WEIGHT[kind] * size, reason=reason
    )


def _names(tracks: Tracks, naming: Naming) -> Iterator[Finding]:
    order, starts = tracks.by_track
    frame = tracks.detections.frame_of
    number = {name: k for k, name in enumerate(tracks.names) if name is not None}
    least: dict[str, int] = {}  # the input track whose name is the least certain
    for i, name in enumerate(naming.markers):
        if name in number and naming.probabilities[i] < DOUBTFUL:
            other = least.get(name, i)
            least[name] = min(other, i, key=lambda j: float(naming.probabilities[j]))
    for name, i in least.items():
        p, q = naming.probabilities[i], naming.alternative_probabilities[i]
        reason = f"probability {p:.0%}; {naming.alternatives[i] or 'no name'} has {q:.0%}"
        first = frame[order[starts[number[name]]]]
        yield _finding("uncertain name", number[name], first, 1 - float(p), reason)
    d = tracks.detections
    at = d.first_frame if isinstance(d, Capture) else 0
    for change in naming.changes:
        if change.name in number:
            reason = f"frames {at + change.first} to {at + change.last}: the track was on "
            reason += f"{change.usual or 'no marker'} and was cut"
            yield _finding("changed marker", number[change.name], change.first, 1.0, reason)


def _doubts(tracks: Tracks) -> Iterator[Finding]:
    if tracks.confidence is None:
        return
    c, frame = tracks.confidence, tracks.detections.frame_of
    for track, group in stretches(tracks, np.flatnonzero((tracks.labels >= 0) & (c < DOUBTFUL))):
        least = group[np.argmin(c[group])]
        reason = f"lowest confidence {100 * c[least]:.0f} %" + (
            f"; {len(group)} points below {100 * DOUBTFUL:.0f} %" if len(group) > 1 else ""
        )
        yield _finding("low confidence", track, frame[least], float((1 - c[group]).sum()), reason)


def _gaps(tracks: Tracks) -> Iterator[Finding]:
    gaps = gaps_of(tracks)
    for k, first, n, seconds in zip(*gaps, strict=True):
        if seconds >= LONG:
            reason = f"no detection for {seconds:.3g} s ({n} frames), then continued"
            yield _finding("long gap", k, first + n, float(seconds), reason)


def _ends(tracks: Tracks) -> Iterator[Finding]:
    """Find tracks that begin or end midway, which are often two tracklets of one marker."""
    d = tracks.detections
    order, starts = tracks.by_track
    for k in np.flatnonzero(tracks.lengths):
        first, last = (d.frame_of[order[i]] for i in (starts[k], starts[k + 1] - 1))
        since, left = d.times[first] - d.times[0], d.times[-1] - d.times[last]
        if since >= LONG:
            reason = f"begins {since:.3g} s after the start: a reappearing marker, or a ghost"
            yield _finding("begun midway", k, first, 1.0, reason)
        if left >= LONG:
            reason = f"ends {left:.3g} s before the end"
            yield _finding("ends early", k, last, 1.0, reason)


def _steps(tracks: Tracks) -> Iterator[Finding]:
    names, frame = tracks.display_names, tracks.detections.frame_of
    jumps: dict[int, StrangeStep] = {}
    swaps: dict[tuple[int, int], list[StrangeStep]] = {}
    for step in strange_steps(tracks):
        k = int(tracks.labels[step.detection])
        if step.other >= 0:
            swaps.setdefault((min(k, step.other), max(k, step.other)), []).append(step)
        else:
            jumps[step.detection] = step
    for steps in swaps.values():
        first = min(steps, key=lambda step: step.detection)
        reason = f"{_off(first)}, where {names[first.other]} was predicted, and vice versa"
        reason += f"; {len(steps)} times in total" if len(steps) > 1 else ""
        k = tracks.labels[first.detection]
        yield _finding("likely swap", k, frame[first.detection], 1.0, reason)
    for k, group in stretches(tracks, np.array(sorted(jumps), dtype=np.int64)):
        worst = max((jumps[int(i)] for i in group), key=lambda step: step.off)
        reason = _off(worst) + (f"; {len(group)} such steps" if len(group) > 1 else "")
        yield _finding("jump", k, frame[worst.detection], min(worst.ratio / 50, 2.0), reason)


def _off(step: StrangeStep) -> str:
    return f"{1e3 * step.off:.0f} mm from its prediction, {step.ratio:.0f} × the track's median"
