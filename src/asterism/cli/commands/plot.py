"""``asterism plot``: one figure of results, for a paper or a screen."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from asterism.checks import check_fields, check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table
from asterism.cli.plot_kinds import KINDS, Kind, Request
from asterism.errors import ParameterError

_Kind = Annotated[str, typer.Argument(metavar="KIND", help="Kind of figure (see above).")]
_Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILES...",
        help="File with tracks or run folder; for some kinds a capture, the observations of a "
        "film, or a calibration.",
    ),
]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="File to write: .pdf, .svg or .png.",
        show_default="FILES with .KIND.pdf",
    ),
]
_Truth = Annotated[
    Path | None, typer.Option(help="True tracks, for errors, reliability and compare.")
]
_Rig = Annotated[
    str | None,
    typer.Option(
        metavar="RIG",
        help="Calibration, or a layout such as ring8 or wall4, for projections and image.",
    ),
]
_Model = Annotated[
    Path | None,
    typer.Option(
        help="Model (TOML), for posterior and groups.", show_default="estimated from the capture"
    ),
]
_Frame = Annotated[
    int | None, typer.Option(help="Frame, for image.", show_default="the middle one")
]
_Camera = Annotated[
    str | None, typer.Option(metavar="NAME", help="Camera, for lens.", show_default="the first")
]
_Moves = Annotated[
    list[float] | None,
    typer.Option(
        help="Moves for each ambiguous detection, for posterior; may be repeated.",
        show_default="0.3, 1, 3, 10, 30, 100",
    ),
]
_Seeds = Annotated[
    int | None,
    typer.Option(help="Number of chains for each --moves, for posterior.", show_default="3"),
]
_Markers = Annotated[
    str | None,
    typer.Option(
        metavar="A,B,…",
        help="Markers by name (* stands for any characters) or track number, for the kinds of "
        "tracks.",
        show_default="all",
    ),
]
_Time = Annotated[
    tuple[float, float] | None,
    typer.Option(
        metavar="START END", help="Seconds, for the kinds of tracks.", show_default="all frames"
    ),
]
_ByTime = Annotated[
    bool, typer.Option("--by-time", help="Colour by time and not by segment, for trajectories.")
]
_Size = Annotated[
    tuple[float, float] | None,
    typer.Option(metavar="WIDTH HEIGHT", help="Inches.", show_default="by kind and content"),
]
_Dpi = Annotated[
    int | None,
    typer.Option(help="Dots per inch of a .png, and of images in a .pdf.", show_default="by kind"),
]


def plot(
    kind: _Kind,
    files: _Files,
    out: _Out = None,
    truth: _Truth = None,
    rig: _Rig = None,
    model: _Model = None,
    frame: _Frame = None,
    camera: _Camera = None,
    moves: _Moves = None,
    seeds: _Seeds = None,
    markers: _Markers = None,
    time: _Time = None,
    by_time: _ByTime = False,
    size: _Size = None,
    dpi: _Dpi = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Draw a figure of results: .pdf or .svg for a paper, .png for a screen.

    The same input gives the same bytes. Kinds of figures:

    KINDS

    For example:

        asterism plot axes trial.tracked.c3d --markers LKNE,RKNE --time 1 3

        asterism plot errors trial.tracked.c3d --truth truth.c3d -o errors.svg

        asterism plot compare runs/gnn runs/mcmcda --truth truth.c3d

        asterism plot projections walk.c3d --rig walk.xcp -o walk.png
    """
    from asterism.cli.outputs import check_outputs
    from asterism.plot.export import write_figure

    check_fields("KIND", [kind], KINDS)
    chosen = KINDS[kind]
    asked = Request(
        files=files, truth=truth, rig=rig, model=model, frame=frame, camera=camera,
        moves=moves or None, seeds=seeds, markers=markers.split(",") if markers else None,
        time=time, by_time=by_time or None,
    )  # fmt: skip
    _check(kind, chosen, asked)
    for inches in size or ():
        check_number("--size", inches, above=1, below=60, closed=True)
    if dpi is not None:
        check_number("--dpi", dpi, above=30, below=1200, closed=True, integer=True)
    out = _default_output(files[0], kind) if out is None else out
    _check_ending(out)
    check_outputs(
        {"--out": out},
        [*files, truth, model, None if rig is None else Path(rig)],
        overwrite=overwrite,
    )
    write_figure(chosen.draw(asked), out, size=size, dpi=dpi)
    if json:
        print_json({"kind": kind, "files": [str(f) for f in files], "output": str(out)})
    elif not quiet:
        print_table([("written", out)])


plot.__doc__ = (plot.__doc__ or "").replace(
    "    KINDS",
    "\n\n".join(f"    [bold cyan]{name}[/bold cyan]  {kind.about}" for name, kind in KINDS.items()),
)


def _check(name: str, kind: Kind, asked: Request) -> None:
    """Raise if an option that the kind needs is missing, or one is given that it does not use."""
    if len(asked.files) > 1 and not kind.many:
        raise ParameterError("FILES", f"one file for {name}", f"{len(asked.files)}")
    for field in dataclasses.fields(asked):
        option = f"--{field.name.replace('_', '-')}"
        is_given = getattr(asked, field.name) is not None
        if field.name == "files" or is_given == (field.name in kind.needs):
            continue
        if not is_given:
            raise ParameterError(option, f"a file, which {name} needs", "nothing")
        if field.name not in kind.takes:
            fit = [k for k, other in KINDS.items() if field.name in other.needs | other.takes]
            raise ParameterError(option, f"a kind that uses it: {', '.join(fit)}", name)
    for n in asked.moves or ():
        check_number("--moves", n, above=0, below=1e6, closed=True)
    if asked.seeds is not None:
        check_number("--seeds", asked.seeds, above=1, below=1000, closed=True, integer=True)


def _check_ending(out: Path) -> None:
    from asterism.plot.export import SUFFIXES

    ending = out.suffix.lower().removeprefix(".")
    if ending not in SUFFIXES:
        raise ParameterError("--out", "a name ending in .pdf, .svg or .png", str(out))


def _default_output(source: Path, kind: str) -> Path:
    """Name the figure after the first file: ``trial.presence.pdf`` beside ``trial.c3d``."""
    path = source.resolve() if source.is_dir() else source
    stem = path.name if source.is_dir() else path.stem
    return path.with_name(f"{stem}.{kind}.pdf")
