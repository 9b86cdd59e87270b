"""``asterism reproduce``: the report's tables and figures made anew, theirs beside ours."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asterism.checks import check_fields, check_number
from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.reproduction.parts import PARTS

if TYPE_CHECKING:
    from asterism.reproduction.part import Made

__all__ = ["reproduce"]

log = logging.getLogger(__name__)

_Quick = Annotated[bool, typer.Option("--quick", help="Few seeds and small sizes: two minutes.")]
_Only = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        metavar="PART",
        help=f"Make this part alone; may be repeated. {', '.join(PARTS)}.",
        show_default="all",
    ),
]
_Seeds = Annotated[
    int | None, typer.Option(help="Seeds of all that is drawn.", show_default="50, quick 5")
]
_Out = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")]

SEEDS, QUICK_SEEDS = 50, 5
MOST_SEEDS = 1000
STEPS = 1000  # of the bar of a part


def reproduce(
    quick: _Quick = False,
    only: _Only = None,
    seeds: _Seeds = None,
    out: _Out = Path("reproduction"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Make every table and figure of the 2010 report anew, and say what could be reproduced.

    Writes one page as Markdown and as HTML that needs nothing beside it, and the figures as SVG
    and PDF. The same seeds give the same bytes; times are in a file of their own. If it is
    stopped, the parts that are finished are written.

    For example:

        asterism reproduce --quick

        asterism reproduce --only mcmcda --only smp --seeds 20 -o tables
    """
    from asterism.cli.outputs import Folder, check_outputs
    from asterism.reproduction.pages import write_pages, write_part
    from asterism.reproduction.part import Effort, Made
    from asterism.reproduction.parts import load

    check_fields("--only", only or [], PARTS)
    n_seeds = (QUICK_SEEDS if quick else SEEDS) if seeds is None else seeds
    check_number("--seeds", n_seeds, above=2, below=MOST_SEEDS, closed=True, integer=True)
    check_outputs({"--out": Folder(out)}, [], overwrite=overwrite)
    out.mkdir(parents=True, exist_ok=True)
    effort = Effort(seeds=n_seeds, is_quick=quick)
    names = [name for name in PARTS if not only or name in only]
    done: list[Made] = []
    try:
        for i, name in enumerate(names):
            with progress(f"{name} ({i + 1} of {len(names)})", STEPS) as advance:
                part = load(name)
                outcome = part.run(effort, lambda share: advance(round(STEPS * share)))
                made = Made(name, part, outcome)
                write_part(made, out)
            done.append(made)
    finally:
        # Also on the way out after a signal: what is finished is worth reading.
        missing = names[len(done) :]
        if done:
            write_pages(done, missing, effort, out)
        if missing:
            where = f"what is finished is in {out}" if done else "nothing is finished"
            log.warning("not made: %s; %s", ", ".join(missing), where)
    _tell(done, out, quiet=quiet, json=json)


def _tell(done: list[Made], out: Path, *, quiet: bool, json: bool) -> None:
    """Print the verdicts."""
    from asterism.reproduction.pages import HTML, MARKDOWN, TIMES

    counts = {made.name: made.counts for made in done}
    if json:
        print_json({
            "folder": str(out),
            "parts": {
                made.name: [
                    {"about": c.about, "theirs": c.theirs, "ours": c.ours, "floor": c.floor,
                     "reproduced": c.verdict.holds, "rule": c.verdict.rule,
                     "because": c.verdict.because}
                    for c in made.outcome.claims
                ]
                for made in done
            },
        })  # fmt: skip
    elif not quiet:
        rows = [(name, f"{n} of {of} reproduced") for name, (n, of) in counts.items()]
        print_table([*rows, ("written", out / HTML), ("", out / MARKDOWN), ("", out / TIMES)])
