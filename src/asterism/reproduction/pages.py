"""Files of a reproduction: a figure and a Markdown file for each part, and the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.io.atomic import write_text
from asterism.plot.export import write_figure
from asterism.reproduction.rules import RULES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from asterism.reproduction.part import Outcome, Part

__all__ = ["PAGE", "TIMES", "write_page", "write_part"]

PAGE, TIMES = "reproduction.md", "times.md"
PARTS, IMAGES = "parts", "images"


def write_part(part: Part, outcome: Outcome, out: Path) -> None:
    """Write the figure and the Markdown file of a part."""
    for folder in (PARTS, IMAGES):
        (out / folder).mkdir(exist_ok=True)
    if outcome.figure is not None:
        write_figure(outcome.figure, out / IMAGES / f"report_{part.name}.svg")
    write_text(out / PARTS / f"{part.name}.md", _part_text(part, outcome))


def write_page(done: Mapping[Part, Outcome], missing: Sequence[str], seeds: int, out: Path) -> None:
    """Write the page, and the files that concern all parts.

    Parameters
    ----------
    done : mapping of Part to Outcome
        Finished parts, whose files are already written.
    missing : sequence of str
        Names of the requested parts that are not finished.
    seeds : int
        Number of seeds.
    out : Path
        Folder to write to.
    """
    contents, rules = _contents_text(done), "".join(f"- **{k}**: {v}\n" for k, v in RULES.items())
    stopped = f"**Stopped before its end. Not made: {', '.join(missing)}.**\n\n" if missing else ""
    page = [
        "# The 2010 report, reproduced\n\n"
        "E. D'Elia, C. Tavian, A. Zugno: Simulation and Multi-Target Tracking, Padua 2010. Its "
        f"figures beside those measured with {seeds} seeds. “±” is a standard deviation over the "
        "seeds. The oracle is the best that the data allow, where that is not everything. Times "
        f"differ from run to run and are in `{TIMES}`.\n\n{stopped}{contents}"
        f"## When a claim counts as reproduced\n\n{rules}",
        *(_part_text(part, outcome) for part, outcome in done.items()),
    ]
    write_text(out / PARTS / "contents.md", contents)
    write_text(out / PARTS / "rules.md", rules)
    write_text(out / PAGE, "\n".join(page))
    write_text(out / TIMES, _times_text(done))


def _contents_text(done: Mapping[Part, Outcome]) -> str:
    rows = [
        [f"[{part.title}](#{part.name})", part.section, part.covers, outcome.n_reproduced]
        for part, outcome in done.items()
    ]
    return _table(("part", "section", "what is reproduced", "reproduced"), rows, n_text=3) + (
        "\nThe report's other figure, 2.2, shows the flow of multiple-hypothesis tracking and has "
        "nothing to measure; its four subroutines bear the same names in `am.MHT`.\n"
    )


def _part_text(part: Part, outcome: Outcome) -> str:
    """Return a part with its heading and an anchor of its name."""
    rows = [
        [c.about, c.reported, c.measured, c.oracle,
         f"**{'' if c.reproduced else 'not '}reproduced**, because {c.because} ({c.rule})"]
        for c in outcome.claims
    ]  # fmt: skip
    pieces = [
        f'<a id="{part.name}"></a>\n',
        f"## {part.title}\n",
        f"*{part.section}: {part.covers}.* {part.summary}\n",
        _table(("", "reported", "measured", "oracle", "verdict"), rows, n_text=5),
    ]
    if outcome.figure is not None:
        pieces += [f"![{part.title}]({IMAGES}/report_{part.name}.svg)\n", f"{part.caption}\n"]
    for table in outcome.tables:
        pieces += [f"{table.title}:\n", _table(table.head, table.rows, n_text=1)]
    for title, notes in (
        ("", part.notes),
        ("Mistakes of the report", part.mistakes),
        ("Assumptions where the report says nothing", part.assumptions),
    ):
        if notes:
            pieces += [f"**{title}.**\n"] if title else []
            pieces.append("".join(f"- {note}\n" for note in notes))
    return "\n".join(pieces)


def _times_text(done: Mapping[Part, Outcome]) -> str:
    rows = [
        [t.about, t.reported, _time(t.seconds)]
        for outcome in done.values()
        for t in outcome.timings
    ]
    head = ("", "reported (Core 2 Duo, MATLAB)", "measured, on one core")
    return _table(head, rows, n_text=1)


def _time(seconds: float) -> str:
    for unit, name in ((1.0, "seconds"), (1e-3, "ms")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 1e-6:.3g} µs"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], *, n_text: int) -> str:
    """Return a table whose first columns are text and whose others are figures."""
    lines = (" | ".join(cell.replace("|", "\\|") for cell in row) for row in (head, *rows))
    first, *others = (f"| {line} |\n" for line in lines)
    rule = "|" + "---|" * n_text + "---:|" * (len(head) - n_text) + "\n"
    return "".join([first, rule, *others])
