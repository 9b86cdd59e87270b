"""From a capture and a job to a result file, its figures and, where asked for, a run folder."""

from __future__ import annotations

import dataclasses
import logging
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.app.console import progress, to_json
from asterism.app.run_folder import CONFIG, SUMMARY, write_text, writing_log
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.app.run_folder import Job

__all__ = ["Gap", "Summary", "carry_out", "default_output", "output_format", "summarize"]

log = logging.getLogger(__name__)

# A log of point clouds has no place for identities.
_WITHOUT_TRACKS = ("pointcloud",)


@dataclass(frozen=True, kw_only=True)
class Gap:
    """Frames in which a track was not seen, between two detections of it.

    Parameters
    ----------
    track : int
        The track.
    first, last : int
        First and last frame without it, as the file counts.
    seconds : float
        From the detection before to the one after.
    """

    track: int
    first: int
    last: int
    seconds: float


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
    longest_gaps : tuple of Gap
        The longest of them, up to three.
    seconds, frames_per_second : float
        Time that the method took, and its pace.
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
    longest_gaps: tuple[Gap, ...]
    seconds: float
    frames_per_second: float

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
            ("time", f"{self.seconds:.3g} s, {self.frames_per_second:,.0f} frames/s"),
            ("written", self.output),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give the figures as plain values."""
        return dataclasses.asdict(self)


def output_format(capture: am.Capture, out: Path | None, name: str | None) -> str:
    """Choose the format of a result.

    Parameters
    ----------
    capture : Capture
        What is tracked.
    out : Path or None
        The file to write, where it is known.
    name : str or None
        The format, where it was asked for.

    Returns
    -------
    str
        As asked for, or told by the name of the file, or that of the capture; where that cannot be
        written C3D, and where it has no place for tracks CSV.

    Raises
    ------
    ParameterError
        If the format is unknown or cannot hold tracks.
    """
    known = {
        f.name: f
        for f in am.FORMATS.values()
        if f.write is not None and f.name not in _WITHOUT_TRACKS
    }
    if name is not None:
        if name not in known:
            expected = f"one that holds tracks: {', '.join(known)}"
            raise ParameterError("--format", expected, repr(name))
        return name
    if out is not None:
        for format in known.values():
            if out.suffix and out.suffix.lower() in format.extensions:
                return format.name
        endings = ", ".join(dict.fromkeys(e for f in known.values() for e in f.extensions))
        raise ParameterError("-o", f"a name ending in {endings}", str(out), "or give --format")
    if capture.format in _WITHOUT_TRACKS:
        return "csv"
    return capture.format if capture.format in known else "c3d"


def default_output(source: Path, format: str) -> Path:
    """Name the result after the capture: ``trial.tracked.c3d`` beside ``trial.c3d``."""
    endings = am.FORMATS[format].extensions
    ending = source.suffix if source.suffix.lower() in endings else endings[0]
    return source.with_name(f"{source.stem}.tracked{ending}")


def carry_out(
    job: Job, capture: am.Capture, out: Path, folder: Path | None
) -> tuple[am.Tracks, Summary]:
    """Track, and write the result and, where a folder is given, the run's files.

    Parameters
    ----------
    job : Job
        What to do.
    capture : Capture
        The capture of the job.
    out : Path
        The file to write.
    folder : Path or None
        An existing folder for ``run.toml``, ``log.txt`` and ``summary.json``.

    Returns
    -------
    Tracks, Summary
    """
    if folder is None:
        return _carry_out(job, capture, out)
    with writing_log(folder):
        write_text(folder / CONFIG, job.to_toml())
        tracks, summary = _carry_out(job, capture, out)
        write_text(folder / SUMMARY, to_json(summary.to_dict()) + "\n")
        return tracks, summary


def _carry_out(job: Job, capture: am.Capture, out: Path) -> tuple[am.Tracks, Summary]:
    for warning in capture.warnings:
        log.info("%s: %s", capture.path, warning)
    method = am.method_by_name(job.method, **job.options)
    log.info("tracking %s (%d frames) with %r", capture.path, capture.n_frames, method)
    method.init(job.model, n_axes=capture.n_axes)  # loads the engine, which is no time of tracking
    start = time.perf_counter()
    with progress(f"tracking with {job.method}", capture.n_frames) as advance:
        tracks = am.track(capture, method, model=job.model, seed=job.seed, progress=advance)
    seconds = time.perf_counter() - start
    am.write(tracks, out, format=job.format)
    summary = summarize(tracks, out=out, method=job.method, seconds=seconds)
    for name, text in summary.rows():
        log.info("%s %s", name, text)
    return tracks, summary


def summarize(tracks: am.Tracks, *, out: Path, method: str, seconds: float) -> Summary:
    """Count what a tracking did.

    Parameters
    ----------
    tracks : Tracks
        The result, over a `Capture`.
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
    frame, track = d.frame_of[order], tracks.labels[order]
    is_gap = (np.diff(track) == 0) & (np.diff(frame) > 1)
    before = np.flatnonzero(is_gap)
    length = frame[before + 1] - frame[before]
    n_labelled = len(order)
    return Summary(
        input=str(d.path),
        output=str(out),
        method=method,
        n_frames=d.n_frames,
        n_detections=d.n_points,
        n_tracks=tracks.n_tracks,
        n_labelled=n_labelled,
        n_clutter=d.n_points - n_labelled,
        n_gaps=len(before),
        longest_gaps=tuple(
            Gap(
                track=int(track[i]),
                first=d.first_frame + int(frame[i]) + 1,
                last=d.first_frame + int(frame[i + 1]) - 1,
                seconds=float(d.times[frame[i + 1]] - d.times[frame[i]]),
            )
            for i in before[np.argsort(-length, kind="stable")[:3]]
        ),
        seconds=seconds,
        frames_per_second=d.n_frames / seconds if seconds else 0.0,
    )
