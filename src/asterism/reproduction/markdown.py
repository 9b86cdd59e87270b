"""The page as Markdown, and its pieces for other documents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.reproduction.rules import RULES
from asterism.reproduction.words import (
    CLAIMS_HEAD,
    CONTENTS_HEAD,
    DRAWN,
    TITLE,
    about,
    stopped,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.reproduction.part import Effort, Made

__all__ = ["contents_text", "page_text", "part_text", "rules_text", "times_text"]


def page_text(done: Sequence[Made], missing: Sequence[str], effort: Effort, images: str) -> str:
    """Give the whole page."""
    lines = [f"# {TITLE}", "", about(effort), ""]
    if missing:
        lines += [f"**{stopped(missing)}**", ""]
    lines += [contents_text(done), "## When something counts as reproduced", "", rules_text()]
    for made in done:
        lines += ["", part_text(made, images).rstrip()]
    return "\n".join([*lines, ""])


def contents_text(done: Sequence[Made]) -> str:
    """Give the table of contents."""
    rows = [
        [
            f"[{made.part.title}](#{made.name})",
            made.part.section,
            made.part.covers,
            "{} of {}".format(*made.counts),
        ]
        for made in done
    ]
    return "\n".join([*_table(CONTENTS_HEAD, rows, 3), "", DRAWN, ""])


def rules_text() -> str:
    """Give the rules by which verdicts are found."""
    return "\n".join(f"- **{name}**: {text}" for name, text in RULES.items())


def part_text(made: Made, images: str) -> str:
    """Give a part, with its heading and an anchor of its name."""
    part, outcome = made.part, made.outcome
    lines = [
        f'<a id="{made.name}"></a>',
        "",
        f"## {part.title}",
        "",
        f"*{part.section}: {part.covers}.* {part.did}",
        "",
    ]
    rows = [
        [c.about, c.theirs, c.ours, c.floor,
         f"{_mark(c.verdict.holds)}, because {c.verdict.because} ({c.verdict.rule})"]
        for c in outcome.claims
    ]  # fmt: skip
    lines += [*_table(CLAIMS_HEAD, rows, len(CLAIMS_HEAD)), ""]
    for picture in outcome.pictures:
        lines += [f"![{part.title}]({images}/{picture.name}.svg)", "", picture.caption, ""]
    for table in outcome.tables:
        lines += [f"{table.title}:", "", *_table(table.head, table.rows, 1), ""]
    for title, notes in (
        ("", outcome.notes),
        ("Where the report is mistaken", part.slips),
        ("What it does not say, and was chosen", part.chosen),
    ):
        if title and notes:
            lines += [f"**{title}.**", ""]
        if notes:
            lines += [*(f"- {note}" for note in notes), ""]
    return "\n".join(lines)


def times_text(done: Sequence[Made]) -> str:
    """Give the times, which differ from run to run."""
    rows = [[t.about, t.theirs, _time(t.seconds)] for made in done for t in made.outcome.timings]
    if not rows:
        return "Nothing was timed.\n"
    head = ("", "the report (Core 2 Duo, MATLAB)", "ours, on one core")
    return "\n".join([*_table(head, rows, 1), ""])


def _time(seconds: float) -> str:
    for unit, name in ((1.0, "seconds"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 1e-6:.2g} µs"


def _mark(holds: bool) -> str:
    return "**reproduced**" if holds else "**not reproduced**"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], n_words: int) -> list[str]:
    """Give a table whose first columns are words and whose others are figures."""
    n = len(head)
    return [
        _row(head),
        "|" + "|".join(["---"] * n_words + ["---:"] * (n - n_words)) + "|",
        *(_row(row) for row in rows),
    ]


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
