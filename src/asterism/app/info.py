"""``asterism info``: what a file holds, and how hard it is."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.app.console import Json, Quiet, print_json, print_table

if TYPE_CHECKING:
    import asterism as am

_File = Annotated[Path, typer.Argument(metavar="FILE", help="Capture to look at.")]


def info(file: _File, quiet: Quiet = False, json: Json = False) -> None:
    """Say what a capture holds, what is odd about it, and how hard its markers are to tell apart.

    Nothing is tracked and nothing written.

    For example:

        asterism info trial.c3d

        asterism info trial.c3d --json
    """
    import asterism as am

    found = am.describe(am.read(file))
    if json:
        print_json(dataclasses.asdict(found))
    elif not quiet:
        print_table(_rows(found))


def _rows(found: am.CaptureInfo) -> list[tuple[str, str]]:
    f = found
    return [
        ("file", f"{f.path} ({f.format}, units {f.units})"),
        ("frames", f"{f.n_frames} from frame {f.first_frame}, {f.rate:g} Hz, {f.duration:.4g} s"),
        ("named markers", f"{f.n_named}"),
        ("without a name", f"{f.n_unlabelled} channels in {f.n_pieces} pieces"),
        ("left out", f"{f.n_modelled} computed points"),
        ("points a frame", f"{f.points_min} to {f.points_max}, {f.points_mean:.4g} on average"),
        ("absent", f"{_number(f.absent_percent)} % of the samples of named markers"),
        ("gaps", f"{f.n_gaps}, median {_number(f.gap_median)}, longest {f.gap_longest} frames"),
        ("step", f"median {_number(f.step_median)}, 99 % below {_number(f.step_99)} mm a frame"),
        (
            "nearest neighbour",
            f"1 % below {_number(f.spacing_1)}, 5 % below {_number(f.spacing_5)}, "
            f"median {_number(f.spacing_50)} mm",
        ),
        ("difficulty", f"{f.difficulty}: {f.reason}"),
        *([("truncated", f.truncated)] if f.truncated else []),
        *(("warning" if i == 0 else "", text) for i, text in enumerate(f.warnings)),
    ]


def _number(value: float) -> str:
    return "–" if value != value else f"{value:.3g}"
