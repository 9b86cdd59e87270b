"""The page as HTML that needs nothing beside it: no scripts, nothing fetched, light and dark."""

from __future__ import annotations

import base64
import hashlib
import re
from html import escape
from typing import TYPE_CHECKING

from asterism.reproduction.inline_svg import inline
from asterism.reproduction.rules import RULES
from asterism.reproduction.style import STYLE
from asterism.reproduction.words import (
    CLAIMS_HEAD,
    CONTENTS_HEAD,
    DRAWN,
    TITLE,
    about,
    stopped,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from asterism.reproduction.part import Claim, Effort, Made, Table

__all__ = ["page_text"]


def page_text(
    done: Sequence[Made], missing: Sequence[str], effort: Effort, pictures: Mapping[str, str]
) -> str:
    """Give the whole page.

    Parameters
    ----------
    done, missing, effort
        As for the Markdown.
    pictures : mapping of str to str
        SVG of the figures, by name.
    """
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    # The one style is allowed by its hash; images are those inside figures.
    policy = (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; "
        "base-uri 'none'; form-action 'none'"
    )
    lines = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        '<meta name="referrer" content="no-referrer">',
        f"<title>{TITLE}</title>",
        f"<style>{STYLE}</style>",
        "</head>",
        "<body>",
        "<main>",
        f"<h1>{TITLE}</h1>",
        f"<p>{_words(about(effort))}</p>",
    ]
    if missing:
        lines.append(f'<p class="stopped">{_words(stopped(missing))}</p>')
    lines += ["<nav>", *_contents(done), f"<p>{_words(DRAWN)}</p>", "</nav>"]
    lines += ["<section>", "<h2>When something counts as reproduced</h2>", "<dl>"]
    lines += [f"<dt>{name}</dt><dd>{_words(text)}</dd>" for name, text in RULES.items()]
    lines += ["</dl>", "</section>"]
    for made in done:
        lines += _part(made, pictures)
    return "\n".join([*lines, "</main>", "</body>", "</html>", ""])


def _contents(done: Sequence[Made]) -> list[str]:
    rows = [
        f'<tr><td><a href="#{made.name}">{_words(made.part.title)}</a></td>'
        f"<td>{_words(made.part.section)}</td><td>{_words(made.part.covers)}</td>"
        f'<td class="n">{made.counts[0]} of {made.counts[1]}</td></tr>'
        for made in done
    ]
    return ['<div class="wide"><table>', _head(CONTENTS_HEAD, n_words=3), *rows, "</table></div>"]


def _part(made: Made, pictures: Mapping[str, str]) -> list[str]:
    part, outcome = made.part, made.outcome
    lines = [
        f'<section id="{made.name}">',
        f"<h2>{_words(part.title)}</h2>",
        f'<p class="where">{_words(part.section)}: {_words(part.covers)}</p>',
        f"<p>{_words(part.did)}</p>",
        '<div class="wide"><table class="claims">',
        _head(CLAIMS_HEAD, n_words=len(CLAIMS_HEAD)),
        *(_claim(c) for c in outcome.claims),
        "</table></div>",
    ]
    for picture in outcome.pictures:
        drawn = inline(pictures[picture.name], picture.name)
        lines += ["<figure>", drawn, f"<figcaption>{_words(picture.caption)}</figcaption>"]
        lines.append("</figure>")
    for table in outcome.tables:
        lines += _table(table)
    lines += _list("", outcome.notes)
    lines += _list("Where the report is mistaken", part.slips)
    lines += _list("What it does not say, and was chosen", part.chosen)
    return [*lines, "</section>"]


def _claim(c: Claim) -> str:
    word, look = ("reproduced", "yes") if c.verdict.holds else ("not reproduced", "no")
    cells = "".join(f"<td>{_words(cell)}</td>" for cell in (c.about, c.theirs, c.ours, c.floor))
    return (
        f'<tr>{cells}<td><strong class="{look}">{word}</strong>, because '
        f"{_words(c.verdict.because)} <small>({c.verdict.rule})</small></td></tr>"
    )


def _table(table: Table) -> list[str]:
    rows = [
        "<tr><td>" + '</td><td class="n">'.join(map(_words, row)) + "</td></tr>"
        for row in table.rows
    ]
    return [
        f'<div class="wide"><table><caption>{_words(table.title)}</caption>',
        _head(table.head, n_words=1),
        *rows,
        "</table></div>",
    ]


def _list(title: str, notes: Sequence[str]) -> list[str]:
    if not notes:
        return []
    heading = [f"<h3>{title}</h3>"] if title else []
    return [*heading, "<ul>", *(f"<li>{_words(note)}</li>" for note in notes), "</ul>"]


def _head(cells: Sequence[str], *, n_words: int) -> str:
    """Give the first row of a table whose first columns are words and whose others are figures."""
    looks = [""] * n_words + [' class="n"'] * (len(cells) - n_words)
    found = (
        f'<th scope="col"{look}>{_words(c)}</th>' for c, look in zip(cells, looks, strict=True)
    )
    return "<tr>" + "".join(found) + "</tr>"


def _words(text: str) -> str:
    """Escape a text; what is in backticks is code."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text, quote=False))
