"""The list of commands."""

from __future__ import annotations

import inspect
from typing import Annotated, Any

import typer

import asterism
from asterism.cli.commands.batch import batch
from asterism.cli.commands.camera import app as camera
from asterism.cli.commands.chain import chain
from asterism.cli.commands.corrupt import corrupt
from asterism.cli.commands.demo import demo
from asterism.cli.commands.edit import edit
from asterism.cli.commands.estimate import estimate
from asterism.cli.commands.evaluate import evaluate
from asterism.cli.commands.fill import fill
from asterism.cli.commands.film import film
from asterism.cli.commands.info import info
from asterism.cli.commands.large import large
from asterism.cli.commands.live import live
from asterism.cli.commands.markerset import app as markerset
from asterism.cli.commands.methods import methods, scenes
from asterism.cli.commands.name import name
from asterism.cli.commands.plot import plot
from asterism.cli.commands.reconstruct import reconstruct
from asterism.cli.commands.report import report
from asterism.cli.commands.reproduce import reproduce
from asterism.cli.commands.serve import serve
from asterism.cli.commands.simulate import simulate
from asterism.cli.commands.stitch import stitch
from asterism.cli.commands.sweep import sweep
from asterism.cli.commands.track import track
from asterism.cli.commands.view import view
from asterism.cli.options import with_option_names

__all__ = ["command"]

app = typer.Typer(
    name="asterism",
    help="Asterism: optical motion capture from camera images to tracks of named markers.",
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
    "Tracks and markers": (track, batch, large, edit, stitch, name, fill, estimate, methods),
    "Captures and results": (info, evaluate, report, plot, view),
    "Streams": (live, serve),
    "Simulations and experiments": (corrupt, simulate, scenes, sweep, demo, reproduce),
    "Cameras": (film, reconstruct, chain),
}
for _title, _commands in _TITLES.items():
    for _command in _commands:
        app.command(rich_help_panel=_title)(with_option_names(_command))
app.add_typer(markerset, rich_help_panel="Tracks and markers")
app.add_typer(camera, rich_help_panel="Cameras")


def _join_lines(command: Any) -> Any:
    """Join the lines of each paragraph of the help, because Typer keeps them apart otherwise."""
    for each in getattr(command, "commands", {}).values():
        _join_lines(each)
    paragraphs = inspect.cleandoc(command.help or "").split("\n\n")
    command.help = "\n\n".join(
        text if text.startswith(" ") else " ".join(text.splitlines()) for text in paragraphs
    )
    return command


command = _join_lines(typer.main.get_command(app))
"""The whole command line, built once a process."""
