"""``asterism view``: tracks and cameras in Rerun's viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table

_Tracked = Annotated[Path, typer.Argument(metavar="TRACKED", help="File with tracks.")]
_Rig = Annotated[
    str | None,
    typer.Option(metavar="RIG", help="Cameras: a calibration, or a layout such as ring8."),
]
_Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE.rrd", help="Write the scene to a file and do not open the viewer."),
]


def view(
    tracked: _Tracked,
    rig: _Rig = None,
    save: _Save = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Show tracks and cameras in the Rerun viewer.

    The command needs Rerun: pip install 'asterism\[view]'. The viewer accepts connections from this
    machine only; its usage statistics are switched off.

    For example:

        asterism view trial.tracked.c3d

        asterism view trial.tracked.csv --rig walk.xcp --save scene.rrd
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs, read_labels
    from asterism.cli.recording import rig_from
    from asterism.errors import ParameterError

    check_ending("--save", save, ".rrd")
    check_outputs(
        {"--save": save}, [tracked, None if rig is None else Path(rig)], overwrite=overwrite
    )
    tracks = read_labels(tracked)
    cameras: am.Rig | None = None
    if rig is not None:
        if tracks.detections.n_axes != 3:
            raise ParameterError("--rig", "tracks in 3-D", f"{tracked}, in 2-D")
        cameras, _ = rig_from(rig, tracks.detections.points)
    am.plot.view(tracks, rig=cameras, path=save)
    if json:
        print_json({"input": str(tracked), "output": None if save is None else str(save)})
    elif save is not None and not quiet:
        print_table([("written", save)])
