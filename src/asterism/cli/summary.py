"""What a tracking did, in figures."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import asterism as am

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["Summary", "stitching_rows", "summarize"]

DOUBTFUL = 0.9


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a tracking did.

    Parameters
    ----------
    input, output : str
        The files.
    method : str
        The method.
    n_frames, n_detections : int
        Size of the capture.
    n_tracks, n_labelled, n_clutter : int
        Tracks, detections in them and detections in none.
    n_gaps : int
        Gaps within tracks.
    longest_gaps : tuple of am.model.Gap
        The longest of them, up to three.
    seconds, frames_per_second : float
        Time that the method took, and its pace.
    log_posterior : float or None
        Of the partition under the model, nats above “everything is clutter”: what methods may be
        compared by. None where the model forbids one of the tracks.
    n_doubtful : int or None
        Detections whose label is held with less than `DOUBTFUL`; None from methods that do not say.
    info : dict
        What the method tells of itself; what was approximated, among others.
    truncated : str
        Where the capture is cut off and what is missing; empty for a whole one.
    """

    input: str
    output: str
    method: str
    n_frames: int
    n_detections: int
    n_tracks: int
    n_labelled: int
    n_clutter: int
    n_gaps: int
    longest_gaps: tuple[am.model.Gap, ...]
    seconds: float
    frames_per_second: float
    log_posterior: float | None
    n_doubtful: int | None
    info: dict[str, float]
    truncated: str = ""

    def rows(self) -> list[tuple[str, str]]:
        """Give the figures as people read them."""
        gaps = [
            f"track {g.track}, frames {g.first} to {g.last} ({g.seconds:.3g} s)"
            for g in self.longest_gaps
        ]
        share = 100 * self.n_labelled / max(self.n_detections, 1)
        return [
            ("tracks", str(self.n_tracks)),
            ("detections labelled", f"{self.n_labelled} of {self.n_detections} ({share:.1f} %)"),
            ("clutter", str(self.n_clutter)),
            ("gaps bridged", str(self.n_gaps)),
            *((("longest gaps"), gap) if i == 0 else ("", gap) for i, gap in enumerate(gaps)),
            *stitching_rows(self.info),
            *self._doubts(),
            *self._posterior(),
            *([("input truncated", self.truncated)] if self.truncated else []),
            ("time", f"{self.seconds:.3g} s, {self.frames_per_second:,.0f} frames/s"),
            ("written", self.output),
        ]

    def _posterior(self) -> list[tuple[str, str]]:
        if self.log_posterior is None:
            return []
        return [("log posterior", f"{self.log_posterior:,.1f} nats above all clutter")]

    def _doubts(self) -> list[tuple[str, str]]:
        rows: list[tuple[str, str]] = []
        if self.n_doubtful is not None:
            rows.append((f"labels held below {DOUBTFUL:.0%}", str(self.n_doubtful)))
        if self.info.get("bound", 0) > 0:
            groups = f"{self.info['approximate_groups']:.0f} groups too large for the exact sum"
            text = f"{groups}; probabilities there off by at most {self.info['bound']:.2g}"
            rows.append(("approximated", text))
        if self.info.get("gap", 0) > 0:
            n = self.info.get("clusters_cut_short") or self.info.get("windows_with_a_gap", 0)
            groups = f"{n:.0f} choices not proven best"
            text = f"{groups}; at most {self.info['gap']:.3g} nats below the best"
            rows.append(("approximated", text))
        if self.info.get("unguarded_groups", 0) > 0:
            text = (
                f"{self.info['unguarded_groups']:.0f} groups too large: moved by their best event"
            )
            rows.append(("guard against coalescence", text))
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Give the figures as plain values."""
        return dataclasses.asdict(self)


def stitching_rows(info: Mapping[str, float]) -> list[tuple[str, str]]:
    """Give what was made of fragments, if anything was."""
    if "joins" not in info:
        return []
    text = f"{info['joins']:.0f} times; {info['cuts']:.0f} links cut, {info['ghosts']:.0f} ghosts"
    return [("markers found again", text)]


def summarize(tracks: am.Tracks, *, out: Path, method: str, seconds: float) -> Summary:
    """Count what a tracking did.

    Parameters
    ----------
    tracks : Tracks
        The result of `track`, over a `Capture`.
    out : Path
        The file it went to.
    method : str
        The method.
    seconds : float
        Time that it took.
    """
    d = tracks.detections
    assert isinstance(d, am.Capture)
    order, _ = tracks.by_track
    gaps = tracks.gaps()
    longest = sorted(gaps, key=lambda gap: -gap.length)[:3]
    n_labelled = len(order)
    info = dict(tracks.info)
    log_posterior = info.pop("log_posterior", -math.inf)
    return Summary(
        input=str(d.path),
        output=str(out),
        method=method,
        n_frames=d.n_frames,
        n_detections=d.n_points,
        n_tracks=tracks.n_tracks,
        n_labelled=n_labelled,
        n_clutter=d.n_points - n_labelled,
        n_gaps=len(gaps),
        longest_gaps=tuple(
            dataclasses.replace(gap, first=d.first_frame + gap.first, last=d.first_frame + gap.last)
            for gap in longest
        ),
        seconds=seconds,
        frames_per_second=d.n_frames / seconds if seconds else 0.0,
        log_posterior=log_posterior if math.isfinite(log_posterior) else None,
        n_doubtful=None
        if tracks.confidence is None
        else int((tracks.confidence[order] < DOUBTFUL).sum()),
        info=info,
        truncated=d.truncated,
    )
