"""``asterism estimate``: the model from the clip."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture.")]
_Out = Annotated[Path | None, typer.Option("--out", "-o", help="TOML file for the model.")]

_Open = Annotated[
    bool,
    typer.Option(
        "--open", help="Markers come and go for good: learn how often, from drawn partitions."
    ),
]
_Runs = Annotated[
    bool,
    typer.Option("--runs", help="Misses may come in runs: learn how likely one ends."),
]


def estimate(
    source: _In,
    out: _Out = None,
    open_population: _Open = False,
    runs: _Runs = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate noise, motion, misses and clutter from the points themselves.

    Each figure is told with what it was read off; `asterism track --model` takes the file.

    For example:

        asterism estimate trial.c3d

        asterism estimate trial.c3d -o model.toml

        asterism estimate arena.csv --open -o model.toml

        asterism estimate behind_limbs.csv --runs -o model.toml
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs
    from asterism.io.atomic import write_text

    check_ending("--out", out, ".toml")
    check_outputs({"--out": out}, [source], overwrite=overwrite)
    capture = am.read(source)
    with progress("estimating the model"):
        found = am.estimate_model(
            capture,
            population="open" if open_population else "closed",
            misses="runs" if runs else "independent",
        )
    if out is not None:
        write_text(out, found.model.to_toml())
    if json:
        reasons = [{"parameter": p, "value": v, "why": why} for p, v, why in found.reasons]
        print_json({"model": found.model.to_dict(), "stds": found.stds, "reasons": reasons})
    elif not quiet:
        print_table(found.reasons, ("parameter", "value", "why"))
        if out is not None:
            print_table([("written", out)])
