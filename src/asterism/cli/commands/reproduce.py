"""``asterism reproduce``: tables and figures of the 2010 report, reported and measured."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.checks import check_fields, check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.reproduction import PARTS

if TYPE_CHECKING:
    from asterism.reproduction.part import Outcome, Part

__all__ = ["reproduce"]

log = logging.getLogger(__name__)

_Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        metavar="PART",
        help=f"Part to reproduce; may be repeated. Parts: {', '.join(PARTS)}.",
        show_default="all",
    ),
]
_Seeds = Annotated[int, typer.Option(help="Number of random seeds; 5 take a minute.")]
_Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")]

MAX_SEEDS = 1000


def reproduce(
    only: _Only = None,
    seeds: _Seeds = 50,
    out: _Out = Path("reproduction"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Reproduce every table and figure of the 2010 report, with a verdict for each claim.

    DIR receives a page in Markdown, figures in SVG and a file of running times. The same seeds give
    the same bytes, except for the times. If the command is stopped, finished parts are written.

    For example:

        asterism reproduce --seeds 5

        asterism reproduce --only mcmcda --only smp --seeds 20 -o tables
    """
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.reproduction import load
    from asterism.reproduction.pages import PAGE, TIMES, write_page, write_part

    check_fields("--only", only or [], PARTS)
    check_number("--seeds", seeds, above=2, below=MAX_SEEDS, closed=True, integer=True)
    check_outputs({"--out": Folder(out)}, [], overwrite=overwrite)
    out.mkdir(parents=True, exist_ok=True)
    names = [name for name in PARTS if not only or name in only]
    done: dict[Part, Outcome] = {}
    try:
        for i, name in enumerate(names):
            with progress(f"{name} ({i + 1} of {len(names)})"):
                part = load(name)
                outcome = part.run(seeds)
                write_part(part, outcome, out)
            done[part] = outcome
    finally:
        # After a signal too: the finished parts are complete.
        missing = names[len(done) :]
        if done:
            write_page(done, missing, seeds, out)
        if missing:
            where = f"the finished parts are in {out}" if done else "no part is finished"
            log.warning("not made: %s; %s", ", ".join(missing), where)
    if json:
        claims = {part.name: [c._asdict() for c in o.claims] for part, o in done.items()}
        print_json({"folder": str(out), "parts": claims})
    elif not quiet:
        rows = [(part.name, f"{o.n_reproduced} reproduced") for part, o in done.items()]
        print_table([*rows, ("written", out / PAGE), ("", out / TIMES)])
