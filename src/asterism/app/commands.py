"""The list of commands."""

from __future__ import annotations

from typing import Annotated

import typer

import asterism
from asterism.app.bonds import bonds
from asterism.app.camera import app as camera
from asterism.app.chain import chain
from asterism.app.corrupt import corrupt
from asterism.app.demo import demo
from asterism.app.estimate import estimate
from asterism.app.evaluate import evaluate
from asterism.app.fill import fill
from asterism.app.film import film
from asterism.app.info import info
from asterism.app.methods import methods, scenes
from asterism.app.options import with_option_names
from asterism.app.plot import plot
from asterism.app.recognize import recognize
from asterism.app.reconstruct import reconstruct
from asterism.app.report import report
from asterism.app.reproduce.command import reproduce
from asterism.app.simulate import simulate
from asterism.app.stitch import stitch
from asterism.app.track import track
from asterism.app.view import view

__all__ = ["app"]

app = typer.Typer(
    name="asterism",
    help="Asterism: name the points of light. Tells which point of an optical motion capture is "
    "which marker, over time.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"asterism {asterism.__version__}")
        raise typer.Exit


@app.callback()
def _root(  # pyright: ignore[reportUnusedFunction]
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    del version


_TITLES = {
    "From points to markers": (track, stitch, fill, bonds, recognize, estimate, methods),
    "What there is, and what came of it": (info, evaluate, report, plot, view),
    "Experiments with a known truth": (corrupt, simulate, scenes, demo, reproduce),
    "Cameras": (film, reconstruct, chain),
}
for _title, _commands in _TITLES.items():
    for _command in _commands:
        app.command(rich_help_panel=_title)(with_option_names(_command))
app.add_typer(camera, rich_help_panel="Cameras")
