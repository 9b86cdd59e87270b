"""``asterism stitch``: tracks of markers from tracklets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture with tracks.")]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model, TOML.", show_default="estimated from IN"),
]
_Confirm = Annotated[
    int, typer.Option(help="Frames after which a tracklet is assigned to a marker.")
]
_Ghosts = Annotated[
    float,
    typer.Option("--ghost-radius", help="Distance of a ghost from its marker, metres."),
]
_MaxOcclusion = Annotated[
    int | None,
    typer.Option(help="Longest occlusion that is stitched, frames.", show_default="unlimited"),
]
_MOST = 10  # joins that are shown


def stitch(
    source: _In,
    out: _Out,
    model: _Model = None,
    confirm: _Confirm = 15,
    ghost_radius: _Ghosts = 0.03,
    max_occlusion: _MaxOcclusion = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Stitch the tracks of a capture through gaps of any length into tracks of markers.

    The position of an occluded marker is predicted from neighbours at a stable distance. This
    command uses the tracks of the file as they are; `asterism track --stitch` tracks anew and makes
    shorter, purer tracklets first.

    For example:

        asterism stitch tracklets.c3d -o markers.c3d

        asterism stitch tracks.csv -o markers.csv --json
    """
    import asterism as am
    from asterism.batch.result_file import output_format
    from asterism.cli.bond_rows import bond_figures, bond_rows
    from asterism.cli.outputs import check_outputs, read_model

    format = output_format(out, None)
    check_outputs({"--out": out}, [source, model], overwrite=overwrite)
    capture = am.read(source)
    if not (capture.labels >= 0).any():
        hint = "run asterism track --stitch first"
        raise ParameterError("IN", "a capture with tracks", f"none in {source}", hint)
    am.io.CAPTURE_FORMATS[format].check(capture)
    if model is None:
        with progress("estimating the model"):
            given = am.estimate_model(capture).model
    else:
        given = read_model(model)
    found = am.stitch(
        capture.tracks,
        am.tracking.tracklet_model(given),
        confirm=confirm,
        ghost_radius=ghost_radius,
        max_occlusion=max_occlusion,
    )
    am.write(found.tracks, out, format=format)
    figures = {
        "input": str(source),
        "output": str(out),
        "n_tracks_before": int((capture.tracks.lengths > 0).sum()),
        "n_tracks": found.tracks.n_tracks,
        "n_tracklets": int(found.tracklets.max(initial=-1)) + 1,
        "n_joins": len(found.joins),
        "n_cuts": len(found.cuts),
        "n_ghosts": len(found.ghosts),
    }
    if json:
        joins = [
            {"marker": j.marker, "last": j.last, "first": j.first, "probability": j.probability}
            for j in found.joins
        ]
        print_json(figures | bond_figures(found.bonds) | {"joins": joins})
    elif not quiet:
        rows = [
            ("tracks", f"{figures['n_tracks']}, from {figures['n_tracks_before']}"),
            ("tracklets", str(figures["n_tracklets"])),
            ("joins", str(len(found.joins))),
            ("cut links", str(len(found.cuts))),
            ("ghosts", str(len(found.ghosts))),
            *bond_rows(found.bonds),
            *_least_certain(found, capture),
            ("written", str(out)),
        ]
        print_table(rows, title="Stitched")


def _least_certain(found: am.tracking.Stitching, capture: am.Capture) -> list[tuple[str, str]]:
    uncertain = sorted(found.joins, key=lambda join: join.probability)[:_MOST]
    return [
        (
            "" if n else "least certain",
            f"track {j.marker}, frames {capture.first_frame + j.last} to "
            f"{capture.first_frame + j.first}: {100 * j.probability:.1f} %",
        )
        for n, j in enumerate(uncertain)
    ]
