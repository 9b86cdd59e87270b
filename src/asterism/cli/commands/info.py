"""``asterism info``: contents of a capture, and how difficult it is to track."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.cli.console import Json, Quiet, print_json, print_table

if TYPE_CHECKING:
    import asterism as am

_Files = Annotated[list[Path], typer.Argument(metavar="FILE", help="Captures to describe.")]


def info(files: _Files, quiet: Quiet = False, json: Json = False) -> None:
    """Describe a capture: markers, gaps, motion, warnings and tracking difficulty.

    Nothing is tracked and no file is written. Several captures are one table, a row each; the exit
    code is 1 if one of them cannot be read.

    For example:

        asterism info trial.c3d

        asterism info captures/*.c3d

        asterism info trial.c3d --json
    """
    import asterism as am

    if len(files) > 1:
        _print_several(files, quiet=quiet, json=json)
        return
    found = am.io.describe(am.read(files[0]))
    if json:
        print_json(dataclasses.asdict(found))
    elif not quiet:
        print_table(_rows(found))


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


def _rows(found: am.io.CaptureInfo) -> list[tuple[str, str]]:
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
