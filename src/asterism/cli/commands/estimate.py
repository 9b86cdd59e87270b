"""``asterism estimate``: the tracking model of a capture."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture, with or without labels.")]
_Out = Annotated[Path | None, typer.Option("--out", "-o", help="Model to write, TOML.")]

_Open = Annotated[
    bool,
    typer.Option(
        "--open", help="Open population: estimate how often markers enter and leave the volume."
    ),
]
_Bursts = Annotated[
    bool,
    typer.Option("--bursts", help="Estimate how long bursts of missed detections last."),
]


def estimate(
    source: _In,
    out: _Out = None,
    open_population: _Open = False,
    bursts: _Bursts = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the tracking model of a capture: noise, motion, detection and clutter.

    The table lists each parameter with its source, and how large the acceleration is that markers
    have in common. `asterism track --model` uses the file.

    For example:

        asterism estimate trial.c3d

        asterism estimate trial.c3d -o model.toml

        asterism estimate arena.csv --open -o model.toml

        asterism estimate behind_limbs.csv --bursts -o model.toml
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs
    from asterism.io.atomic import write_text
    from asterism.reporting.shared_evidence import capture_evidence

    check_ending("--out", out, ".toml")
    check_outputs({"--out": out}, [source], overwrite=overwrite)
    capture = am.read(source)
    with progress("estimating the model"):
        found = am.estimate_model(
            capture,
            population="open" if open_population else "closed",
            misses="bursts" if bursts else "independent",
        )
    if out is not None:
        write_text(out, found.model.to_toml())
    if quiet and not json:
        return
    with progress("comparing accelerations"):
        shared = capture_evidence(capture, found.model)
    if json:
        reasons = [{"parameter": p, "value": v, "why": why} for p, v, why in found.reasons]
        plain = None if shared is None else dataclasses.asdict(shared)
        model = found.model.to_dict()
        print_json({"model": model, "stds": found.stds, "reasons": reasons, "shared": plain})
    else:
        common = [] if shared is None else [("shared acceleration", shared.value, shared.why)]
        print_table([*found.reasons, *common], ("parameter", "value", "why"))
        if out is not None:
            print_table([("written", out)])
