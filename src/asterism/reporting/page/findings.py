"""Findings: gaps, jumps, ends and errors of tracks, one entry a cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
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

__all__ = ["Finding", "find_troubles"]

LONG = 0.1
"""Shortest long gap, seconds."""
_WEIGHT = {  # what each kind counts beside the others
    "wrong marker": 100.0, "switch": 80.0, "likely swap": 50.0, "changed marker": 30.0,
    "jump": 10.0, "begun midway": 3.0, "ends early": 2.0, "long gap": 1.0, "missed": 1.0,
}  # fmt: skip
TOGETHER = 0.1
"""Time within which findings of one kind are one entry, seconds; 1.5 frames at lower rates."""
_TOGETHER = {  # what several tracks do at a time
    "wrong marker": "tracks change to another marker", "switch": "markers change their track",
    "likely swap": "pairs of tracks swap", "changed marker": "tracks change their marker",
    "jump": "tracks jump", "begun midway": "tracks begin", "ends early": "tracks end",
    "long gap": "tracks continue after a gap", "missed": "markers lose their label",
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Place at which tracks may be wrong.

    Parameters
    ----------
    kind : str
        Kind, such as ``"likely swap"``.
    track : int
        Track of the finding, the worst of several, -1 for none.
    frame : int
        Frame, counted from 0.
    weight : float
        Severity, by which findings are sorted.
    reason : str
        Reason in words.
    count : int
        Number of findings of this kind at this time that are this entry.
    """

    kind: str
    track: int
    frame: int
    weight: float
    reason: str
    count: int = 1


def find_troubles(
    tracks: Tracks, judgement: Judgement | None = None, naming: Naming | None = None
) -> list[Finding]:
    """Find gaps, jumps, ends and errors of tracks.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the page.
    judgement : Judgement, optional
        Comparison with the truth, whose errors are added.
    naming : Naming, optional
        Result of the naming, whose changes of marker are added.

    Returns
    -------
    list of Finding
        Findings in the order of their weights, the largest first. Findings of one kind within
        `TOGETHER` are one.
    """
    found = [*_gaps(tracks), *_ends(tracks), *_steps(tracks)]
    if judgement is not None:
        found += [
            _finding(kind, track, frame, size, reason)
            for kind, track, frame, size, reason in errors(tracks, judgement)
        ]
    if naming is not None:
        found += _changes(tracks, naming)
    return sorted(_merged(tracks, found), key=lambda f: (-f.weight, f.frame, f.track))


def _merged(tracks: Tracks, found: list[Finding]) -> Iterator[Finding]:
    """Merge the findings of one kind that begin at one time."""
    times, names = tracks.detections.times, tracks.display_names
    near = max(TOGETHER, 1.5 * tracks.detections.step)
    groups: list[list[Finding]] = []
    for f in sorted(found, key=lambda f: (f.kind, f.frame, f.track)):
        last = groups[-1] if groups else []
        if last and last[0].kind == f.kind and times[f.frame] - times[last[0].frame] <= near:
            last.append(f)
        else:
            groups.append([f])
    for group in groups:
        worst = max(group, key=lambda f: f.weight)
        n = len({f.track for f in group}) if worst.track >= 0 else len(group)
        if n == 1:
            yield from group
            continue
        reason = f"{n} {_TOGETHER[worst.kind]} at {times[group[0].frame]:.2f} s; "
        reason += f"{names[worst.track]}: {worst.reason}" if worst.track >= 0 else worst.reason
        weight = sum(f.weight for f in group)
        yield replace(worst, frame=group[0].frame, weight=weight, reason=reason, count=len(group))


def _finding(kind: str, track: Any, frame: Any, size: float, reason: str) -> Finding:
    return Finding(
        kind=kind, track=int(track), frame=int(frame), weight=_WEIGHT[kind] * size, reason=reason
    )


def _changes(tracks: Tracks, naming: Naming) -> Iterator[Finding]:
    number = {name: k for k, name in enumerate(tracks.names) if name is not None}
    d = tracks.detections
    at = d.first_frame if isinstance(d, Capture) else 0
    for change in naming.changes:
        if change.name in number:
            reason = f"frames {at + change.first} to {at + change.last}: the track was on "
            reason += f"{change.usual or 'no marker'} and was cut"
            yield _finding("changed marker", number[change.name], change.first, 1.0, reason)


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
