"""Printing: results go to stdout, log messages and progress to stderr."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from asterism.cli.exit_codes import BROKEN_PIPE

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Mapping, Sequence

    from rich.console import Console

__all__ = [
    "Json",
    "Overwrite",
    "Quiet",
    "console",
    "print_json",
    "print_table",
    "progress",
]

Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only warnings and errors.")]

_PIPED_WIDTH = 200  # columns without a terminal, so that most lines are not wrapped


def console(*, stderr: bool = False) -> Console:
    """Return the console for results, or for log messages with ``stderr=True``."""
    from rich.console import Console

    class PipeConsole(Console):
        def on_broken_pipe(self) -> NoReturn:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(BROKEN_PIPE)

    stream = sys.stderr if stderr else sys.stdout
    has_width = stream.isatty() or "COLUMNS" in os.environ
    return PipeConsole(stderr=stderr, highlight=False, width=None if has_width else _PIPED_WIDTH)


def print_table(
    rows: Iterable[Sequence[object]], header: Sequence[str] = (), *, title: str = ""
) -> None:
    """Print rows of cells as a table without lines; cells are printed without markup."""
    from rich.table import Table
    from rich.text import Text

    rows = [[str(cell) for cell in row] for row in rows]
    table = Table(box=None, pad_edge=False, show_header=bool(header))
    for i in range(max(map(len, [*rows, header]))):
        table.add_column(header[i] if header else "", overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    screen = console()
    if title:
        screen.print(Text(title, style="bold"))
    with screen.capture() as printed:
        screen.print(table)
    # Rich pads the last column to its longest cell; those blanks are of no use in a file.
    lines = (line.rstrip() for line in printed.get().splitlines())
    screen.out("\n".join(lines), highlight=False)


def print_json(value: Mapping[str, Any]) -> None:
    """Print plain values as one JSON object."""
    from asterism.io.json_text import to_json

    console().print(to_json(value), markup=False, soft_wrap=True)


@contextmanager
def progress(what: str, total: int | None = None) -> Generator[Callable[[int], None], None, None]:
    """Show a progress bar on stderr while the block runs, if stderr is a terminal.

    Parameters
    ----------
    what : str
        Name of the step.
    total : int, optional
        Number of steps. Without it the bar shows only that the step runs.

    Yields
    ------
    callable
        Function of the number of finished steps.
    """
    from rich.progress import Progress

    screen = console(stderr=True)
    with Progress(console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)
