"""``asterism large``: track a table with very many detections in a frame."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress

__all__ = ["large"]

_In = Annotated[
    Path,
    typer.Argument(
        metavar="IN", help="Table with a row for each detection: .parquet, .csv, .tsv or .txt."
    ),
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="Table to write, in the form of IN.")]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model, TOML.", show_default="estimated from a crop of the first frames"),
]
_Frame = Annotated[
    str | None, typer.Option(help="Column of the frame number.", show_default="frame")
]
_Time = Annotated[
    str | None, typer.Option(help="Column of the time, seconds.", show_default="time, time_s or t")
]
_Axes = Annotated[
    str | None,
    typer.Option(metavar="X,Y[,Z]", help="Columns of the coordinates.", show_default="x, y and z"),
]
_Unit = Annotated[
    str | None,
    typer.Option(
        help="Unit of length: mm, cm, m, in or ft.", show_default="that of the columns' names, or m"
    ),
]
_Rate = Annotated[float, typer.Option(help="Frames per second of a table without times.")]
_Label = Annotated[str, typer.Option(help="Name of the column of track labels.")]
_Tile = Annotated[
    float | None,
    typer.Option(
        help="Side of a spatial tile, metres. It does not change the result.",
        show_default="for 25 000 detections",
    ),
]
_Threads = Annotated[int, typer.Option(help="Threads. They do not change the result.")]
_Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers solve the tiles."),
]
_LookAhead = Annotated[
    int, typer.Option(help="Later frames that are seen before a frame is assigned, 0 to 4.")
]


def large(
    source: _In,
    out: _Out,
    model: _Model = None,
    frame: _Frame = None,
    time: _Time = None,
    axes: _Axes = None,
    unit: _Unit = None,
    rate: _Rate = 1.0,
    label: _Label = "track",
    tile: _Tile = None,
    threads: _Threads = 1,
    scheduler: _Scheduler = None,
    look_ahead: _LookAhead = 1,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Track a table with very many detections in a frame, such as particles or swarms.

    The rows must stand in the order of frames. They are read and written a part at a time, so the
    memory does not depend on the number of frames. The output has the rows of IN in the same order
    and a column of track labels, -1 for none. It appears when it is complete; after an error or an
    interrupt nothing is left. Parquet needs pip install 'asterism\[parquet]', and a scheduler
    pip install 'asterism\[cluster]'.

    For example:

        asterism large swarm.parquet -o tracked.parquet

        asterism large particles.csv -o tracked.csv --axes u,v --unit mm --rate 500

        asterism large swarm.parquet -o tracked.parquet --model model.toml --threads 8 --json
    """
    import asterism as am
    from asterism.cli.outputs import check_outputs, read_model
    from asterism.large.track import check_form

    check_form(source, out)
    check_outputs({"--out": out}, [source, model], overwrite=overwrite)
    columns = am.large.Columns(
        frame=frame, time=time, axes=None if axes is None else tuple(axes.split(",")), unit=unit,
        rate=rate, label=label,
    )  # fmt: skip
    given = None if model is None else read_model(model)
    where = nullcontext() if scheduler is None else am.batch.cluster_map(scheduler)
    with where as mapper, progress("tracking") as advance:
        run = am.large.track(
            source, out, model=given, columns=columns, tile=tile, threads=threads,
            mapper=mapper, look_ahead=look_ahead, progress=advance,
        )  # fmt: skip
    if json:
        print_json(_figures(source, run))
    elif not quiet:
        share = run.n_labelled / max(run.n_points, 1)
        print_table(
            [
                ("frames", f"{run.n_frames:,}, {run.frame_seconds:.3g} s each (median)"),
                ("detections", f"{run.n_points:,}, {100 * share:.1f} % in tracks"),
                ("tracks", f"{run.n_tracks:,}"),
                ("model", repr(run.model)),
                ("written", str(out)),
            ],
            title="Tracked",
        )


def _figures(source: Path, run: Any) -> dict[str, Any]:
    names = ("n_frames", "n_points", "n_tracks", "n_labelled", "n_tiles", "largest_group",
             "n_joined", "seconds", "frame_seconds")  # fmt: skip
    return {
        "input": str(source),
        "output": str(run.output),
        **{name: getattr(run, name) for name in names},
        "model": run.model.to_dict(),
    }
