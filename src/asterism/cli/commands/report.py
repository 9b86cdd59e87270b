"""``asterism report``: tracks as an HTML page with a player."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from asterism.checks import check_file
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

__all__ = ["report"]

_In = Annotated[list[Path], typer.Argument(metavar="TRACKED", help="Captures with tracks.")]
_Truth = Annotated[Path | None, typer.Option(help="True tracks; wrong labels are marked.")]
_Rig = Annotated[Path | None, typer.Option(help="Calibration of the cameras.")]
_Out = Annotated[
    Path | None, typer.Option("--out", "-o", help="Page to write.", show_default="TRACKED.html")
]
_Up = Annotated[
    Literal["x", "y", "z"] | None,
    typer.Option(help="Axis that points up.", show_default="from the rig or the format"),
]
_Title = Annotated[
    str | None, typer.Option(help="Title of the page.", show_default="the file name")
]

_Editor = Annotated[
    bool,
    typer.Option("--editor", help="Add an editor, which collects edits and downloads them."),
]


def report(
    sources: _In,
    truth: _Truth = None,
    rig: _Rig = None,
    out: _Out = None,
    up: _Up = None,
    title: _Title = None,
    editor: _Editor = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write tracks as one HTML page that leads with the places to check.

    The page opens in any browser and loads nothing from the network. Each capture has its own.

    For example:

        asterism report trial.tracked.c3d

        asterism report tracked/*.c3d

        asterism report tracked.c3d --truth truth.c3d --rig trial.xcp -o page.html
    """
    import asterism as am
    from asterism.cli.outputs import check_ending, check_outputs, read_labels

    single = {"--out": out, "--truth": truth, "--title": title}
    given = [name for name, value in single.items() if value is not None]
    if len(sources) > 1 and given:
        raise ParameterError(", ".join(given), "one capture", f"{len(sources)}")
    pages = [source.with_suffix(".html") if out is None else out for source in sources]
    check_ending("--out", out, ".html", ".htm")
    for source in sources:
        check_file(source)
    written = {"--out": pages[0]} if len(pages) == 1 else {f"--out ({p})": p for p in pages}
    check_outputs(written, [*sources, truth, rig], overwrite=overwrite)
    true = None if truth is None else am.io.read_tracks(truth)
    cameras = None if rig is None else am.read_rig(rig)
    with progress("writing the page", len(sources)) as advance:
        for n, (source, page) in enumerate(zip(sources, pages, strict=True)):
            tracks = read_labels(source)
            am.report(
                tracks, page, truth=true, rig=cameras, up=up, title=title,
                summary=_origin(tracks), editor=editor,
            )  # fmt: skip
            advance(n + 1)
    made = [
        {"input": str(source), "output": str(page), "bytes": page.stat().st_size}
        for source, page in zip(sources, pages, strict=True)
    ]
    if json:
        print_json(made[0] if len(made) == 1 else {"reports": made})
    elif not quiet:
        rows = [("written", f"{page}, {page.stat().st_size / 1e6:.2f} MB") for page in pages]
        print_table(rows, title="Report")


def _origin(tracks: am.Tracks) -> list[tuple[str, str]]:
    """Return the name, format and rate of the file."""
    import asterism as am

    d = tracks.detections
    if not isinstance(d, am.Capture):
        return []
    rate = f", {d.rate:g} frames/s" if d.rate else ""
    return [
        ("file", d.path.name),
        ("format", f"{am.io.CAPTURE_FORMATS[d.format].description}{rate}"),
    ]
