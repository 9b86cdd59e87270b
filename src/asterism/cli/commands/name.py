"""``asterism name``: names for tracks, from the marker set of another capture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

__all__ = ["name"]

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture with tracks.")]
_Bonds = Annotated[
    Path, typer.Option("--bonds", metavar="TOML", help="Marker set of `asterism bonds`.")
]
_Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
_CERTAIN = 0.9


def name(
    source: _In,
    bonds: _Bonds,
    out: _Out,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Name tracks by the marker set of another capture of the same subject.

    Names in IN are ignored. Tracklets of one marker become one track.

    For example:

        asterism bonds labelled.c3d -o subject.toml

        asterism track next.c3d --stitch -o tracked.c3d

        asterism name tracked.c3d --bonds subject.toml -o named.c3d
    """
    import asterism as am
    from asterism.cli.outputs import check_outputs
    from asterism.cli.tracking import output_format

    format = output_format(out, None)
    check_outputs({"--out": out}, [source, bonds], overwrite=overwrite)
    known = am.tracking.Bonds.from_toml(bonds)
    capture = am.read(source)
    if not (capture.labels >= 0).any():
        hint = "run asterism track --stitch first"
        raise ParameterError("IN", "a capture with tracks", f"none in {source}", hint)
    tracks = capture.tracks.measured()
    found = am.name_tracks(tracks, known)
    am.write(found.tracks, out, format=format)
    has = found.markers >= 0
    seen = {known.names[k] for k in found.markers[has]}
    missing = [name for name in known.names if name not in seen]
    uncertain = sorted(
        (float(p), known.names[k])
        for p, k in zip(found.probabilities[has], found.markers[has], strict=True)
        if p < _CERTAIN
    )
    if json:
        print_json(
            {
                "input": str(source),
                "output": str(out),
                "n_tracks": int((tracks.lengths > 0).sum()),
                "n_named": found.n_named,
                "names": [
                    {"track": k, "name": known.names[marker], "probability": float(p)}
                    for k, (marker, p) in enumerate(
                        zip(found.markers, found.probabilities, strict=True)
                    )
                    if marker >= 0
                ],
                "not_found": missing,
            }
        )
    elif not quiet:
        below = ", ".join(f"{name} {100 * p:.0f} %" for p, name in uncertain)
        rows = [
            ("tracks named", f"{found.n_named} of {int((tracks.lengths > 0).sum())}"),
            ("markers not found", ", ".join(missing) or "none"),
            (f"below {_CERTAIN:.0%}", below or "none"),
            ("written", str(out)),
        ]
        print_table(rows, title="Named")
