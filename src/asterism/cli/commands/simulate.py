"""``asterism simulate``: scenes of moving markers with a known truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

_Scene = Annotated[str, typer.Argument(metavar="SCENE", help="One of `asterism scenes`.")]
_Out = Annotated[
    Path,
    typer.Option(
        "--out", "-o", help="File for the markers; with --truth, for points without names."
    ),
]
_Truth = Annotated[
    Path | None,
    typer.Option(help="File for the same points with their true names.", show_default=False),
]
_Frames = Annotated[int | None, typer.Option(help="Number of frames.", show_default="the scene's")]
_Rate = Annotated[float | None, typer.Option(help="Frame rate, Hz.", show_default="the scene's")]
_Markers = Annotated[
    int | None, typer.Option(help="Number of markers.", show_default="the scene's")
]
_Seed = Annotated[int | None, typer.Option(help="Random seed.", show_default="0")]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the scene; may be repeated."),
]
_Corruption = Annotated[
    list[str] | None,
    typer.Option(
        "--corrupt",
        metavar="NAME=VALUE",
        help="Corruption of the capture (missing, clutter, noise, burst, ghosts, visits, "
        "nearby, doubled, merged, dropped, jitter …); may be repeated.",
    ),
]
_Rig = Annotated[
    str | None,
    typer.Option(
        "--rig",
        metavar="RIG",
        help="Cameras: a calibration, or a layout such as ring8 or wall4. Markers that fewer than "
        "two of them see are left out.",
        show_default=False,
    ),
]


def simulate(
    scene: _Scene,
    out: _Out,
    truth: _Truth = None,
    frames: _Frames = None,
    rate: _Rate = None,
    markers: _Markers = None,
    seed: _Seed = None,
    option: _Options = None,
    corruption: _Corruption = None,
    rig: _Rig = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Simulate moving markers, and write them with or without corruption.

    `asterism scenes` lists the scenes and their options. The same seed gives the same bytes.

    For example:

        asterism simulate person -o walk.c3d --option activity=walk --markers 60

        asterism simulate crossing -o a.c3d --truth t.c3d --corrupt burst=5:5-60

        asterism simulate two_people -o a.csv --truth t.csv --rig ring8
    """
    import numpy as np

    import asterism as am
    from asterism.cli.options import as_options
    from asterism.cli.outputs import check_outputs
    from asterism.cli.recording import made_scene, rig_from, switches_from
    from asterism.io.captures.files import format_to_write

    if (corruption or rig) and truth is None:
        expected = "a file for the truth, as --corrupt or --rig is given"
        hint = "without it no file would hold the true labels"
        raise ParameterError("--truth", expected, "none", hint)
    with as_options({"path": "--out"}):
        format_to_write(out, None)
    if truth is not None:
        with as_options({"path": "--truth"}):
            format_to_write(truth, None)
    check_outputs({"--out": out, "--truth": truth}, [], overwrite=overwrite)
    given = {"frames": frames, "rate": rate, "seed": seed, "markers": markers}
    switches: dict[str, Any] = switches_from(corruption or [])
    made, values = made_scene(scene, given, option or [])
    result: am.Tracks = made
    about = ""
    if truth is not None:
        if rig is not None:
            switches["rig"], about = rig_from(rig, made.detections.points)
        with as_options({name: f"--corrupt {name}" for name in switches}):
            corrupted = am.simulate.corrupt(made, **switches, seed=values["seed"])
        values |= {"corruption": corrupted.record}
        d = corrupted.detections
        am.write(corrupted, truth)
        result = am.Tracks(detections=d, labels=np.full(d.n_points, -1))
    am.write(result, out)
    figures = {
        "n_frames": result.detections.n_frames,
        "n_markers": made.n_tracks,
        "n_detections": result.detections.n_points,
    }
    if json:
        files = {"output": str(out), **({} if truth is None else {"truth": str(truth)})}
        print_json({**files, "scene": scene, "options": values, **figures})
    elif not quiet:
        size = "{n_markers} markers, {n_frames} frames, {n_detections} detections".format(**figures)
        rows: list[tuple[str, object]] = [(scene, size)]
        if about:
            rows.append(("rig", about))
        if truth is not None:
            record = ", ".join(f"{k}={v}" for k, v in values["corruption"].items() if k != "rig")
            rows += [("corruption", record), ("truth", truth)]
        print_table([*rows, ("written", out)])
