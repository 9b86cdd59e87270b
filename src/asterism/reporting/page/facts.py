"""Counts of a result, as figures and as a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.reporting.page.runs import gaps_of

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["Facts", "cards", "facts_of", "in_words"]


class Facts(NamedTuple):
    """Counts of a result.

    Attributes
    ----------
    n_frames, n_points, n_tracks, n_named, n_labelled, n_clutter, n_filled : int
        Number of frames; of points, measured or filled; of tracks with a point, and with a name; of
        points in tracks, in clutter, and filled.
    seconds, rate : float
        Time from the first to the last frame in seconds, and frame rate in Hz.
    n_gaps : int
        Number of gaps within tracks.
    longest_gap : float
        Longest gap, seconds.
    """

    n_frames: int
    n_points: int
    n_tracks: int
    n_named: int
    n_labelled: int
    n_clutter: int
    n_filled: int
    seconds: float
    rate: float
    n_gaps: int
    longest_gap: float


def facts_of(tracks: Tracks) -> Facts:
    """Count the frames, points, tracks and gaps of tracks."""
    d = tracks.detections
    is_labelled = tracks.labels >= 0
    gaps = gaps_of(tracks)
    names = np.array([name is not None for name in tracks.names], dtype=bool)
    return Facts(
        n_frames=d.n_frames,
        n_points=d.n_points,
        n_tracks=int(np.count_nonzero(tracks.lengths)),
        n_named=int(np.count_nonzero(names & (tracks.lengths > 0))),
        n_labelled=int(is_labelled.sum()),
        n_clutter=int((~is_labelled).sum()),
        n_filled=0 if d.filled is None else int(d.filled.sum()),
        seconds=float(d.times[-1] - d.times[0]) if d.n_frames else 0.0,
        rate=1 / d.step if d.step else 0.0,
        n_gaps=len(gaps.track),
        longest_gap=float(gaps.seconds.max(initial=0.0)),
    )


def in_words(facts: Facts, n_axes: int) -> str:
    """Return the counts as a sentence."""
    if not facts.n_frames:
        return "An empty capture: no frame, no point, no track."
    span = _count(facts.n_frames, "frame") + ("" if n_axes == 3 else " of a 2-D capture")
    if facts.rate:
        span += f" ({facts.seconds:.3g} s at {facts.rate:.4g} Hz)"
    if not facts.n_points:
        return f"{span} without points."
    if not facts.n_tracks:
        return f"{span}. None of the {_count(facts.n_points, 'point')} is in a track: all clutter."
    named = "" if not facts.n_named else ", all named," if facts.n_named == facts.n_tracks else ""
    if facts.n_named and not named:
        named = f", {facts.n_named:,} of them named,"
    return f"{_count(facts.n_tracks, 'track')}{named} over {span}."


def cards(facts: Facts) -> list[tuple[str, str, str]]:
    """Return the figures at the top of the page: key for scripts, number and label."""
    share = _percent(100 * facts.n_labelled / facts.n_points) if facts.n_points else "–"
    gap = f", longest {facts.longest_gap:.2g} s" if facts.n_gaps else ""
    found = [
        ("tracks", f"{facts.n_tracks:,}", _only("track", facts.n_tracks)),
        ("labelled", share, f"of {_count(facts.n_points, 'point')} labelled"),
        ("gaps", f"{facts.n_gaps:,}", f"{_only('gap', facts.n_gaps)}{gap}"),
        ("clutter", f"{facts.n_clutter:,}", "points of clutter"),
    ]
    if facts.n_filled:
        found.append(("filled", f"{facts.n_filled:,}", "filled points, not measured"))
    return found


def _percent(share: float) -> str:
    """Round a percentage, but never to 0 or 100 unless it is exact."""
    if share in (0.0, 100.0):
        return f"{share:.0f} %"
    return f"{min(max(share, 0.1), 99.9):.1f} %"


def _only(noun: str, n: int) -> str:
    return noun if n == 1 else noun + "s"


def _count(n: int, noun: str) -> str:
    return f"{n:,} {_only(noun, n)}"
