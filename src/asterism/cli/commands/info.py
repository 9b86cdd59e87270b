"""``asterism info``: contents of a capture, and how difficult it is to track."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.cli.console import Json, Quiet, print_json, print_table

if TYPE_CHECKING:
    import asterism as am
    from asterism.reporting.shared_evidence import SharedEvidence

_Files = Annotated[list[Path], typer.Argument(metavar="FILE", help="Captures to describe.")]


def info(files: _Files, quiet: Quiet = False, json: Json = False) -> None:
    """Describe a capture: markers, gaps, motion, warnings and tracking difficulty.

    Where the file has tracks, the acceleration is stated that its markers have in common. Nothing
    is tracked and no file is written. Several captures are one table, a row each; the exit
    code is 1 if one of them cannot be read.

    For example:

        asterism info trial.c3d

        asterism info captures/*.c3d

        asterism info trial.c3d --json
    """
    import asterism as am
    from asterism.io.captures.files import read_unlogged

    if len(files) > 1:
        _print_several(files, quiet=quiet, json=json)
        return
    # The rows and the JSON hold the warnings of the file.
    capture = am.read(files[0]) if quiet and not json else read_unlogged(files[0])
    found = am.io.describe(capture)
    if json:
        shared = _shared(capture)
        plain = None if shared is None else dataclasses.asdict(shared)
        print_json({**dataclasses.asdict(found), "shared": plain})
    elif not quiet:
        print_table(_rows(found, _shared(capture)))


def _shared(capture: am.Capture) -> SharedEvidence | None:
    """Measure how the tracks of the file accelerate together; None where they are too few."""
    import asterism as am
    from asterism.reporting.shared_evidence import shared_evidence

    if capture.tracks.n_tracks < 2:
        return None
    try:
        model = am.estimate_model(capture).model
    except am.ParameterError:  # there are too few links
        return None
    return shared_evidence(capture.tracks, model)


def _print_several(files: list[Path], *, quiet: bool, json: bool) -> None:
    """Print one row for each capture."""
    import asterism as am

    found: list[am.io.CaptureInfo | str] = []
    for path in files:
        try:
            found.append(am.io.describe(am.read(path)))
        except am.FormatError as error:
            found.append(str(error))
    if json:
        plain: list[dict[str, object]] = []
        for path, each in zip(files, found, strict=True):
            failed = isinstance(each, str)
            plain.append({"path": path, "error": each} if failed else dataclasses.asdict(each))
        print_json({"captures": plain})
    elif not quiet:
        header = ("file", "frames", "Hz", "named", "points a frame", "difficulty")
        rows = [
            (path, "–", "–", "–", "–", each)
            if isinstance(each, str)
            else (
                path, each.n_frames, f"{each.rate:g}", each.n_named, f"{each.points_mean:.4g}",
                each.difficulty,
            )
            for path, each in zip(files, found, strict=True)
        ]  # fmt: skip
        print_table(rows, header)
    if any(isinstance(each, str) for each in found):
        raise typer.Exit(1)


def _rows(found: am.io.CaptureInfo, shared: SharedEvidence | None) -> list[tuple[str, str]]:
    f = found
    rows = [
        ("file", f"{f.path} ({f.format}, units {f.units})"),
        ("frames", f"{f.n_frames} from frame {f.first_frame}, {f.rate:g} Hz, {f.duration:.4g} s"),
        ("named markers", f"{f.n_named}"),
        ("unnamed", _unnamed(f)),
        ("left out", f"{f.n_modelled} computed points"),
        ("points per frame", f"{f.points_min} to {f.points_max}, {f.points_mean:.4g} on average"),
    ]
    if f.n_named:
        gaps = f", median {_number(f.gap_median)}, longest {f.gap_longest} frames"
        rows += [
            ("absent", f"{_number(f.absent_percent)} % of the samples of named markers"),
            ("gaps", f"{f.n_gaps}{gaps if f.n_gaps else ''}"),
        ]
    rows += _steps("step", f.step_median, f.step_99)
    if not f.n_named:
        rows += _steps("step to nearest", f.nearest_step_median, f.nearest_step_99)
    spacing = (
        f"1 % below {_number(f.spacing_1)}, 5 % below {_number(f.spacing_5)}, "
        f"median {_number(f.spacing_50)} mm"
    )
    return [
        *rows,
        ("nearest neighbour", spacing if f.points_max > 1 else "none: at most one point per frame"),
        *([] if shared is None else shared.rows()),
        ("difficulty", f"{f.difficulty}: {f.reason}"),
        *([("truncated", f.truncated)] if f.truncated else []),
        *(("warning" if i == 0 else "", text) for i, text in enumerate(f.warnings)),
    ]


def _unnamed(f: am.io.CaptureInfo) -> str:
    """Describe the points without a named marker: channels, tracklets and single points."""
    parts = [f"{f.n_unlabelled} channels"] if f.n_unlabelled else []
    if f.n_pieces:
        parts = [f"{parts[0]} in {f.n_pieces} tracklets" if parts else f"{f.n_pieces} tracks"]
    if f.n_unidentified:
        parts.append(f"{f.n_unidentified} of {f.n_points} points without a track")
    return "; ".join(parts) or "none"


def _steps(what: str, median: float, most: float) -> list[tuple[str, str]]:
    if median != median:
        return []
    return [(what, f"median {_number(median)}, 99 % below {_number(most)} mm per frame")]


def _number(value: float) -> str:
    return "–" if value != value else f"{value:.3g}"
