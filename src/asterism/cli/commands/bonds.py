"""``asterism bonds``: the marker set of a capture, and its rigid clusters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

__all__ = ["bond_figures", "bond_rows", "bonds"]

_In = Annotated[Path, typer.Argument(metavar="IN", help="Capture with named tracks.")]
_Out = Annotated[Path | None, typer.Option("--out", "-o", help="Marker set to write, TOML.")]
_Neighbours = Annotated[int, typer.Option(help="Largest number of bonds per marker.")]


def bonds(
    source: _In,
    out: _Out = None,
    neighbours: _Neighbours = 12,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Find the markers that keep their mutual distance, and the rigid clusters.

    `asterism name` uses the marker set to name the tracks of another capture of the same subject.

    For example:

        asterism bonds labelled.c3d

        asterism bonds labelled.c3d -o subject.toml
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs
    from asterism.io.atomic import write_text
    from asterism.io.captures.marker_names import is_unlabelled

    check_ending("--out", out, ".toml")
    check_outputs({"--out": out}, [source], overwrite=overwrite)
    capture = am.read(source)
    if not (capture.labels >= 0).any():
        hint = "run asterism track first"
        raise ParameterError("IN", "a capture with tracks", f"none in {source}", hint)
    n_named = sum(bool(name) and not is_unlabelled(name) for name in capture.names)
    n_unnamed = len(capture.names) - n_named
    if not n_named:
        hint = "name the markers first"
        got = f"{n_unnamed} tracks without a name in {source}"
        raise ParameterError("IN", "a capture with named markers", got, hint)
    found = am.learn_bonds(capture.tracks, neighbours=neighbours)
    if out is not None:
        write_text(out, found.to_toml())
    if json:
        written = None if out is None else str(out)
        figures = {"n_markers": len(found.names), "n_left_out": n_unnamed} | bond_figures(found)
        print_json({"input": str(source), "output": written} | figures)
    elif not quiet:
        rows = [("markers", str(len(found.names))), *bond_rows(found)]
        rows += [("not used", f"{n_unnamed} tracks without a name")] if n_unnamed else []
        rows += [("written", str(out))] if out is not None else []
        print_table(rows, title="Bonds")


def bond_figures(found: am.tracking.Bonds) -> dict[str, Any]:
    """Return the bonds and clusters as plain values."""
    return {
        "n_bonds": len(found.pairs),
        "n_rigid": int(found.rigid.sum()),
        "clusters": [[found.names[k] for k in cluster] for cluster in found.clusters],
    }


def bond_rows(found: am.tracking.Bonds) -> list[tuple[str, str]]:
    """Return the bonds and clusters as rows of the printed table."""
    rows = [("bonds", f"{len(found.pairs)}, {int(found.rigid.sum())} rigid")]
    for n, cluster in enumerate(found.clusters):
        inside = [i in cluster and j in cluster for i, j in found.pairs]
        worst = 1e3 * float(found.spreads[inside].max())
        names = " ".join(found.names[k] for k in cluster)
        rows.append(("" if n else "rigid clusters", f"{names} (within {worst:.1f} mm)"))
    return rows
