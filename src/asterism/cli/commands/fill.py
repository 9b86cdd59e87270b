"""``asterism fill``: positions for the gaps of tracks."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.checks import check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture with tracks.")]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
_Longest = Annotated[float, typer.Option(help="Longest gap that is filled, seconds.")]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model, TOML.", show_default="estimated from IN"),
]
_Unflagged = Annotated[
    bool,
    typer.Option(
        "--unflagged",
        help="Allow a format that cannot mark filled points.",
    ),
]
_MOST = 10  # gaps that are shown


def fill(
    source: _In,
    out: _Out,
    longest: _Longest = 1.0,
    model: _Model = None,
    unflagged: _Unflagged = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Fill the gaps of tracks, with a standard deviation for each gap.

    Positions are estimated from the marker's own motion, its rigid cluster and all other markers.
    Artificial gaps in measured frames give the weight of each estimator. Filled points are marked:
    in C3D by residual 0, in CSV by a column. Earlier fills are removed first.

    For example:

        asterism fill trial.tracked.c3d -o filled.c3d

        asterism fill tracks.csv -o filled.csv --longest 0.5 --json

        asterism fill trial.tracked.c3d -o filled.trc --unflagged
    """
    import asterism as am
    from asterism.batch.result_file import output_format
    from asterism.cli.outputs import check_outputs, read_model

    format = output_format(out, None)
    if not (am.io.CAPTURE_FORMATS[format].keeps_filled or unflagged):
        able = ", ".join(name for name, f in am.io.CAPTURE_FORMATS.items() if f.keeps_filled)
        raise ParameterError(
            "--out", f"a format that marks filled points: {able}", str(out),
            "or give --unflagged",
        )  # fmt: skip
    check_outputs({"--out": out}, [source, model], overwrite=overwrite)
    check_number("--longest", longest, above=0, below=1e9)
    tracks = am.io.read_tracks(source)
    capture = tracks.detections
    assert isinstance(capture, am.Capture)
    if not (tracks.labels >= 0).any():
        raise ParameterError(
            "IN", "a capture with tracks", f"none in {source}", "run asterism track first"
        )
    am.io.CAPTURE_FORMATS[format].check(capture)
    given = None if model is None else read_model(model)
    with progress("filling") as advance:
        found = am.fill_gaps(tracks, model=given, longest=longest, progress=advance)
    am.write(found.tracks, out, format=format, unflagged=unflagged)
    figures: dict[str, Any] = _figures(found) | {"input": str(source), "output": str(out)}
    if json:
        print_json(figures | {"gaps": [_plain(gap, capture) for gap in found.gaps]})
    elif not quiet:
        by = ", ".join(f"{name} {n}" for name, n in figures["estimators"].items())
        rows = [
            ("gaps", str(figures["n_gaps"])),
            ("filled", f"{figures['n_filled']}, {figures['n_points']} points"),
            *([("main estimator", by)] if by else []),
            *[
                ("" if n else "not filled", f"{count}, {reason}")
                for n, (reason, count) in enumerate(figures["left"].items())
            ],
            *_least_certain(found, capture),
            ("written", str(out)),
        ]
        print_table(rows, title="Filled")


def _figures(found: am.tracking.Filling) -> dict[str, Any]:
    filled = [gap for gap in found.gaps if gap.is_filled]
    return {
        "n_gaps": len(found.gaps),
        "n_filled": len(filled),
        "n_points": sum(map(len, filled)),
        "estimators": dict(Counter(gap.estimator for gap in filled).most_common()),
        "left": dict(Counter(gap.reason for gap in found.gaps if gap.reason).most_common()),
        "largest_std": max((gap.std for gap in filled), default=math.nan),
    }


def _plain(gap: am.tracking.FilledGap, capture: am.Capture) -> dict[str, Any]:
    """Return a gap as plain values, with the frame numbers of the file."""
    return {
        "track": gap.track,
        "first": capture.first_frame + gap.first,
        "last": capture.first_frame + gap.last,
        "seconds": gap.seconds,
        "estimator": gap.estimator,
        "weights": dict(gap.weights),
        "rms": dict(gap.rms),
        "n_windows": gap.n_windows,
        "std": gap.std,
        "n_neighbours": gap.n_neighbours,
        "reason": gap.reason,
    }


def _least_certain(found: am.tracking.Filling, capture: am.Capture) -> list[tuple[str, str]]:
    filled = [gap for gap in found.gaps if gap.is_filled]
    names = found.tracks.names
    return [
        (
            "" if n else "least certain",
            f"{names[gap.track] or f'track {gap.track}'}, frames {capture.first_frame + gap.first} "
            f"to {capture.first_frame + gap.last}: ±{1e3 * gap.std:.3g} mm, {gap.estimator}"
            + ("" if gap.n_windows else " (not validated: no measured frames to test it on)"),
        )
        for n, gap in enumerate(sorted(filled, key=lambda gap: -gap.std)[:_MOST])
    ]
