"""``asterism simulate``: scenes in motion whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asterism.app.console import Json, Quiet, print_json, print_table
from asterism.errors import check_fields

_Scene = Annotated[str, typer.Argument(metavar="SCENE", help="One of `asterism scenes`.")]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File for the named markers.")]
_Frames = Annotated[int | None, typer.Option(help="Number of frames.", show_default="the scene's")]
_Rate = Annotated[float | None, typer.Option(help="Frames a second.", show_default="the scene's")]
_Seed = Annotated[int, typer.Option(help="Chooses everything that is random.")]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the scene; may be repeated."),
]


def simulate(
    scene: _Scene,
    out: _Out,
    frames: _Frames = None,
    rate: _Rate = None,
    seed: _Seed = 0,
    option: _Options = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate markers in motion and write them with their names; spoil them with `corrupt`.

    For example:

        asterism simulate crossing -o truth.c3d --rate 100

        asterism simulate smooth -o truth.csv --frames 300 --option n_markers=20
    """
    import asterism as am
    from asterism.app.options import parsed, scene_options

    scenes = am.simulate.SCENES
    check_fields("scene", [scene], scenes)
    make = scenes[scene].make
    values = parsed(f"scene {scene}", option or [], scene_options(make))
    given = {"frames": frames, "rate": rate, "seed": seed}
    values |= {name: value for name, value in given.items() if value is not None}
    truth = make(**values)
    am.write(truth, out)
    d = truth.detections
    if json:
        figures = {"n_frames": d.n_frames, "n_markers": truth.n_tracks, "n_detections": d.n_points}
        print_json({"output": str(out), "scene": scene, "options": values, **figures})
    elif not quiet:
        size = f"{truth.n_tracks} markers, {d.n_frames} frames, {d.n_points} detections"
        print_table([(scene, size), ("written", out)])
