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

_Kind = Annotated[str, typer.Argument(metavar="KIND", help="What to draw, one of the kinds above.")]
_Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILES...",
        help="What to draw it of: a file with tracks, or the folder of a run; a capture, a film's "
        "observations or a calibration where the kind says so.",
    ),
]
_Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="File to write, .pdf, .svg or .png; by default FILES with .KIND.pdf in its name.",
    ),
]
_Truth = Annotated[Path | None, typer.Option(help="What is so: errors, reliability, compare.")]
_Rig = Annotated[
    str | None,
    typer.Option(
        metavar="RIG", help="A calibration, or ring8, wall4 and the like: projections, image."
    ),
]
_Model = Annotated[
    Path | None,
    typer.Option(help="Model, TOML: posterior, groups.", show_default="estimated from the capture"),
]
_Frame = Annotated[
    int | None, typer.Option(help="Which frame: image.", show_default="the middle one")
]
_Camera = Annotated[
    str | None, typer.Option(metavar="NAME", help="Which camera: lens.", show_default="the first")
]
_Moves = Annotated[
    list[float] | None,
    typer.Option(
        help="Moves for each detection in doubt: posterior; may be repeated.",
        show_default="0.3, 1, 3, 10, 30, 100",
    ),
]
_Seeds = Annotated[
    int | None, typer.Option(help="How many walks with each: posterior.", show_default="3")
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
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Draw a figure of results: vectors for a paper (.pdf, .svg), pixels for a screen (.png).

    The same input gives the same bytes. Kinds:

    KINDS

    For example:

        asterism plot presence trial.tracked.c3d

        asterism plot errors trial.tracked.c3d --truth truth.c3d -o errors.svg

        asterism plot compare runs/gnn runs/mcmcda --truth truth.c3d -o compare.pdf

        asterism plot projections walk.c3d --rig walk.xcp -o walk.png
    """
    from asterism.cli.outputs import check_outputs
    from asterism.plot.export import write_figure

    check_fields("KIND", [kind], KINDS)
    chosen = KINDS[kind]
    asked = Request(
        files=files, truth=truth, rig=rig, model=model, frame=frame, camera=camera,
        moves=moves or None, seeds=seeds,
    )  # fmt: skip
    _check(kind, chosen, asked)
    out = _default_output(files[0], kind) if out is None else out
    _check_ending(out)
    check_outputs(
        {"--out": out},
        [*files, truth, model, None if rig is None else Path(rig)],
        overwrite=overwrite,
    )
    write_figure(chosen.draw(asked), out)
    if json:
        print_json({"kind": kind, "files": [str(f) for f in files], "output": str(out)})
    elif not quiet:
        print_table([("written", out)])


plot.__doc__ = (plot.__doc__ or "").replace(
    "    KINDS",
    "\n\n".join(f"    [bold cyan]{name}[/bold cyan]  {kind.about}" for name, kind in KINDS.items()),
)


def _check(name: str, kind: Kind, asked: Request) -> None:
    """Raise if the kind lacks something, or something was given that it does not look at."""
    if len(asked.files) > 1 and not kind.many:
        raise ParameterError("FILES", f"one file for {name}", f"{len(asked.files)}")
    for field in dataclasses.fields(asked):
        option = f"--{field.name}"
        is_given = getattr(asked, field.name) is not None
        if field.name == "files" or is_given == (field.name in kind.needs):
            continue
        if not is_given:
            raise ParameterError(option, f"a file, which {name} needs", "nothing")
        if field.name not in kind.takes:
            fit = [k for k, other in KINDS.items() if field.name in other.needs | other.takes]
            raise ParameterError(
                option, f"nothing for {name}", "one", f"it is for {', '.join(fit)}"
            )
    for n in asked.moves or ():
        check_number("--moves", n, above=0, below=1e6, closed=True)
    if asked.seeds is not None:
        check_number("--seeds", asked.seeds, above=1, below=1000, closed=True, integer=True)


def _check_ending(out: Path) -> None:
    from asterism.plot.export import ENDINGS

    ending = out.suffix.lower().removeprefix(".")
    if ending not in ENDINGS:
        raise ParameterError("--out", "a name ending in .pdf, .svg or .png", str(out))


def _default_output(source: Path, kind: str) -> Path:
    """Name the picture after the first file: ``trial.presence.pdf`` beside ``trial.c3d``."""
    path = source.resolve() if source.is_dir() else source
    stem = path.name if source.is_dir() else path.stem
    return path.with_name(f"{stem}.{kind}.pdf")
