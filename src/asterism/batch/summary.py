"""Figures of a finished tracking."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import asterism as am
from asterism.reporting.names_found import naming_figures, naming_rows
from asterism.reporting.places import places_of
from asterism.reporting.shared_evidence import SharedEvidence, shared_evidence

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["Summary", "stitching_rows", "summarize"]


REMOVED = "removed before the tracking: model and log posterior hold without it"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Figures of a finished tracking.

    Parameters
    ----------
    input, output : str
        Paths of capture and result.
    method : str
        Name of the method.
    n_frames, n_detections : int
        Size of the capture.
    n_tracks, n_labelled, n_clutter : int
        Number of tracks, of their detections, and of detections without a track.
    n_gaps : int
        Number of gaps in tracks.
    n_edits : int
        Number of edits that the tracks respect.
    common_motion : bool
        Whether the motion that most markers have in common was removed before the tracking. The
        model and the log posterior hold without it.
    longest_gaps : tuple of am.model.Gap
        Longest gaps, at most three.
    gap_names : tuple of str or None
        Marker name of the track of each of these gaps; None without one.
    seconds, frames_per_second : float
        Running time of the method, and frames per second.
    log_posterior : float or None
        Log posterior of the tracks, in nats above that of “everything is clutter”. Larger is
        better under the same model. None if the model gives a track probability zero.
    places : int
        Number of places to check, as on the report page.
    expected_wrong : float
        Expected number of detections with a wrong identity at these places.
    info : dict
        Figures of the method, such as the error of approximations.
    shared : SharedEvidence or None
        Size of the acceleration that the markers of rigid segments have in common, and its
        evidence on frames left out; None where the method has no bonds.
    naming : dict or None
        Names and their probabilities as plain values; None without marker sets.
    filled : dict or None
        Number of gaps and of those that were filled; None if none were to be filled.
    truncated : str
        Place at which the capture is cut off, and the missing part; empty for a complete one.
    named : tuple of (str, str)
        Names as rows of the printed table.
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
    n_edits: int
    common_motion: bool
    longest_gaps: tuple[am.model.Gap, ...]
    gap_names: tuple[str | None, ...]
    seconds: float
    frames_per_second: float
    log_posterior: float | None
    places: int
    expected_wrong: float
    info: dict[str, float]
    shared: SharedEvidence | None = None
    naming: dict[str, Any] | None = None
    filled: dict[str, int] | None = None
    truncated: str = ""
    named: tuple[tuple[str, str], ...] = ()

    def rows(self) -> list[tuple[str, str]]:
        """Return the figures as rows of the printed table."""
        gaps = [
            f"{name or f'track {g.track}'}, frames {g.first} to {g.last} ({g.length} "
            f"frame{'s' * (g.length > 1)}, {g.seconds:.3g} s between detections)"
            for g, name in zip(self.longest_gaps, self.gap_names, strict=True)
        ]
        share = 100 * self.n_labelled / max(self.n_detections, 1)
        return [
            *([("edits", f"{self.n_edits} respected")] if self.n_edits else []),
            *([("motion in common", REMOVED)] if self.common_motion else []),
            ("tracks", str(self.n_tracks)),
            ("detections labelled", f"{self.n_labelled} of {self.n_detections} ({share:.1f} %)"),
            ("clutter", str(self.n_clutter)),
            ("gaps", str(self.n_gaps)),
            *((("longest gaps"), gap) if i == 0 else ("", gap) for i, gap in enumerate(gaps)),
            *stitching_rows(self.info),
            *(self.shared.rows() if self.shared else []),
            *self.named,
            *self._filled(),
            *self._certainty(),
            *self._posterior(),
            *([("input truncated", self.truncated)] if self.truncated else []),
            ("time", f"{self.seconds:.3g} s, {self.frames_per_second:,.0f} frames/s"),
            ("written", self.output),
        ]

    def _filled(self) -> list[tuple[str, str]]:
        if self.filled is None:
            return []
        return [("gaps filled", f"{self.filled['n_filled']} of {self.filled['n_gaps']}")]

    def _posterior(self) -> list[tuple[str, str]]:
        if self.log_posterior is None:
            return []
        return [("log posterior", f"{self.log_posterior:,.1f} nats above all clutter")]

    def _certainty(self) -> list[tuple[str, str]]:
        rows: list[tuple[str, str]] = []
        wrong = f", {self.expected_wrong:.0f} wrong labels expected" if self.places else ""
        rows.append(("places to check", f"{self.places}{wrong}"))
        if self.info.get("bound", 0) > 0:
            groups = f"{self.info['approximate_groups']:.0f} groups too large for the exact sum"
            text = f"{groups}; error of their probabilities at most {self.info['bound']:.2g}"
            rows.append(("approximated", text))
        if self.info.get("gap", 0) > 0:
            n = self.info.get("clusters_cut_short") or self.info.get("windows_with_a_gap", 0)
            groups = f"{n:.0f} assignments not proven optimal"
            text = f"{groups}; at most {self.info['gap']:.3g} nats below the optimum"
            rows.append(("approximated", text))
        if self.info.get("unguarded_groups", 0) > 0:
            n = self.info["unguarded_groups"]
            text = f"{n:.0f} groups too large for the guard against coalescence"
            rows.append(("approximated", text))
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain values."""
        values = dataclasses.asdict(self)
        del values["named"]  # the same as `naming`, as it is printed
        for gap, name in zip(values["longest_gaps"], values.pop("gap_names"), strict=True):
            gap["name"] = name
        return values


def stitching_rows(info: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the result of stitching as rows of the printed table; empty without stitching."""
    if "joins" not in info:
        return []
    parts = {"joins": "join", "cuts": "cut link", "ghosts": "ghost"}
    text = (f"{info[key]:.0f} {part}{'s' * (info[key] != 1)}" for key, part in parts.items())
    return [("stitching", ", ".join(text))]


def summarize(
    result: am.tracking.Tracked, *, out: Path, method: str, seconds: float, n_edits: int
) -> Summary:
    """Compute the figures of a finished tracking.

    Parameters
    ----------
    result : Tracked
        Result of `am.tracking.carry_out` for a `Capture`.
    out : Path
        File of the result.
    method : str
        Name of the method.
    seconds : float
        Running time.
    n_edits : int
        Number of edits that the tracks respect.
    """
    tracks, naming, filling = result.tracks.measured(), result.naming, result.filling
    recipe = result.recipe
    # Without a common motion the model holds for other coordinates.
    has_bonds = recipe.options.get("rigid") is not None and not recipe.common_motion
    d = tracks.detections
    assert isinstance(d, am.Capture)
    places = places_of(tracks)
    gaps = tracks.gaps()
    longest = sorted(gaps, key=lambda gap: -gap.length)[:3]
    n_labelled = int(tracks.lengths.sum())
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
        n_edits=n_edits,
        common_motion=recipe.common_motion,
        longest_gaps=tuple(
            dataclasses.replace(gap, first=d.first_frame + gap.first, last=d.first_frame + gap.last)
            for gap in longest
        ),
        gap_names=tuple(tracks.names[gap.track] for gap in longest),
        seconds=seconds,
        frames_per_second=d.n_frames / seconds if seconds else 0.0,
        log_posterior=log_posterior if math.isfinite(log_posterior) else None,
        places=len(places),
        expected_wrong=sum(place.expected_wrong for place in places),
        info=info,
        shared=shared_evidence(tracks, recipe.model) if has_bonds else None,
        naming=None if naming is None else naming_figures(naming),
        filled=None
        if filling is None
        else {"n_gaps": len(filling.gaps), "n_filled": filling.n_filled},
        truncated=d.truncated,
        named=() if naming is None else tuple(naming_rows(naming)),
    )
