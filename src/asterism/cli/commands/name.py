"""``asterism name``: names for tracks, from the marker sets of the subjects."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

__all__ = ["name"]

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture with tracks.")]
_Markers = Annotated[
    list[Path] | None,
    typer.Option(
        "--markers",
        metavar="SET",
        help="Marker set (TOML, VSK, VST), or a labelled capture; one for each subject.",
        show_default="the names in IN",
    ),
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]


def name(
    source: _In,
    out: _Out,
    markers: _Markers = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Name tracks by the marker set of the subject, or by the names in IN.

    With a marker set names in IN are ignored. Without one they are kept where the distances in IN
    do not contradict them. Tracklets of one marker become one track; a track that changed marker is
    cut. A track without a probable name keeps none.

    For example:

        asterism markerset learn static.c3d -o ann.toml

        asterism track next.c3d -o tracked.c3d

        asterism name tracked.c3d --markers ann.toml -o named.c3d

        asterism name labelled.c3d -o named.c3d
    """
    import asterism as am
    from asterism.batch.result_file import output_format
    from asterism.cli.outputs import check_outputs
    from asterism.reporting.names_found import naming_figures, naming_rows
    from asterism.tracking.naming.from_file import read_markers
    from asterism.tracking.naming.own_names import has_own_names

    format = output_format(out, None)
    check_outputs({"--out": out}, [source, *(markers or [])], overwrite=overwrite)
    sets = [read_markers(path) for path in markers or []]
    capture = am.read(source)
    if not (capture.labels >= 0).any():
        hint = "run asterism track first"
        raise ParameterError("IN", "a capture with tracks", f"none in {source}", hint)
    am.io.CAPTURE_FORMATS[format].check(capture)
    tracks = capture.tracks.measured()
    if not sets and not has_own_names(capture):
        raise ParameterError("--markers", "a marker set", f"none, and no names in {source}")
    found = am.name_tracks(tracks, *sets)
    am.write(found.tracks, out, format=format)
    if json:
        print_json({"input": str(source), "output": str(out)} | naming_figures(found))
    elif not quiet:
        print_table([*naming_rows(found), ("written", str(out))], title="Named")
