"""Figures that pages quote are those of the tables that they come from.

A mark ``<!-- from speed.md: 50 & 1 -->`` in a page holds what follows it, up to the end of the
paragraph or table, the next mark or ``<!-- end -->``, to docs/tables/speed.md: each number must be
there, rounded as the page rounds it, in a line that has both texts, be it in the row itself, in
the head of its table or in the line above that. Semicolons part several such sources. A row of a
quoted table, its first cell left out, must be found in order, in one line of each source in turn.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from tests.paths import ROOT

DOCS = ROOT / "docs"
PAGES = [
    page
    for page in (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
    if page.parent.name != "tables" and "<!-- from " in page.read_text(encoding="utf-8")
]

_MARK = re.compile(r"<!-- (?:from (?P<sources>[^>]+?)|end) -->\n*")
_NUMBER = re.compile(
    r"(?<![\w.])(?<!\w-)"  # not in IDF1, 5.0.0 or x86-64
    r"(\d{1,3}(?:[ ,]\d{3})+|\d+)(\.\d+)?(e-?\d+)?"
    r"(?!\w|[.,]\d|-\w)"
)
_NOT_PROSE = re.compile(r"`[^`]*`|(?<=\])\([^)]*\)")


@dataclass(frozen=True)
class Figure:
    """A number as a page writes it, and half a unit of the last digit that it means."""

    text: str
    value: float
    half: float

    def is_rounded_from(self, value: float) -> bool:
        return abs(value - self.value) <= self.half * (1 + 1e-9)


def figures_of(text: str) -> list[Figure]:
    found: list[Figure] = []
    for whole, decimals, exponent in _NUMBER.findall(text):
        digits = re.sub(r"\D", "", whole)
        places = len(decimals[1:])
        if not decimals and len(digits) > 3:  # 67 000 means thousands
            places = len(digits.rstrip("0")) - len(digits)
        value = float(f"{digits}{decimals}{exponent}")
        scale = float(f"1{exponent}") if exponent else 1.0
        found.append(Figure(f"{whole}{decimals}{exponent}", value, 0.5 * 10.0**-places * scale))
    return found


def lines_of(source: str) -> list[list[float]]:
    """Give the numbers of each line of a table file that has all texts of a source."""
    name, _, texts = source.partition(":")
    above = head = ""
    kept: list[list[float]] = []
    for line in (DOCS / "tables" / name.strip()).read_text(encoding="utf-8").splitlines():
        is_row = line.startswith("|")
        if not is_row:
            above, head = line or above, ""
        elif not head:
            head = line
        about = f"{above} {head} {line}" if is_row else line
        if all(text.strip() in about for text in texts.split("&")):
            kept.append([figure.value for figure in figures_of(line.replace("**", ""))])
    assert kept, f"no line of {source}"
    return kept


def quotes_of(page: str) -> list[tuple[str, str]]:
    """Give the sources of each mark and the text that it holds to them."""
    marks = list(_MARK.finditer(page))
    starts = [mark.start() for mark in marks] + [len(page)]
    quotes: list[tuple[str, str]] = []
    for mark, following in zip(marks, starts[1:], strict=True):
        if mark["sources"]:
            text = page[mark.end() : following].split("\n\n")[0]
            quotes.append((mark["sources"], text))
    return quotes


def parts_of(text: str) -> list[list[Figure]]:
    """Give what must be found together: a row of a table, or a single number of prose."""
    if not text.startswith("|"):
        return [[figure] for figure in figures_of(_NOT_PROSE.sub("", text))]
    rows = [line.strip("| ").split("|") for line in text.splitlines()[2:]]
    return [figures_of(_NOT_PROSE.sub("", " | ".join(cells[1:]))) for cells in rows]


def unsourced(part: list[Figure], sources: list[list[list[float]]]) -> Figure | None:
    """Give the first figure that is not found: in order, in one line of each source in turn."""
    n = 0
    for lines in sources:
        n = max(found_in(line, part, n) for line in lines)
    return part[n] if n < len(part) else None


def found_in(line: list[float], part: list[Figure], n: int) -> int:
    """Give how many figures are found when a line follows what held the first n."""
    for value in line:
        n += n < len(part) and part[n].is_rounded_from(value)
    return n


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_quoted_figure_is_in_its_table(page):
    wrong: list[str] = []
    for named, text in quotes_of(page.read_text(encoding="utf-8")):
        sources = [lines_of(source) for source in named.split(";")]
        parts = parts_of(text)
        assert any(parts), f"from {named}: nothing is quoted"
        found = [unsourced(part, sources) for part in parts]
        wrong += [f"{figure.text} is not in {named}" for figure in found if figure is not None]
    assert not wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_changed_figure_is_noticed(page):
    # A mark that takes in half a file would find nearly any number there. Three units of the last
    # digit: neighbours in a table are often one apart.
    seen = total = 0
    for named, text in quotes_of(page.read_text(encoding="utf-8")):
        sources = [lines_of(source) for source in named.split(";")]
        for part in parts_of(text):
            for i, figure in enumerate(part):
                for step in (-6, 6):
                    changed = Figure(figure.text, figure.value + step * figure.half, figure.half)
                    planted = [*part[:i], changed, *part[i + 1 :]]
                    seen += unsourced(planted, sources) is not None
                    total += 1
    assert seen > 0.9 * total, f"{seen} of {total}"


@pytest.mark.parametrize(("page", "n"), [("README.md", 1), ("docs/measured/results.md", 2)])
def test_every_table_of_results_is_held(page, n):
    source = (ROOT / page).read_text(encoding="utf-8")
    tables = re.findall(r"(?m)(?<=\n\n)\|.*(?:\n\|.*)*", source)
    assert len(tables) == n
    held = [text for _, text in quotes_of(source)]
    assert not [table.splitlines()[0] for table in tables if table not in held]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_mark_does_not_end_a_paragraph(page):
    # Markdown takes a comment at the beginning of a line for a block of HTML.
    for line in re.findall(r"(?m)^ *<!-- (?:from|end).*", page.read_text(encoding="utf-8")):
        assert line.endswith("-->")
        assert f"\n\n{line}\n\n" in page.read_text(encoding="utf-8")


def test_how_numbers_are_read():
    text = "IDF1 of 0.912, 67 000 frames/s on x86-64 (1,078,181), 2-core, OpenCV 5.0.0, 1e-9, -0.5."
    assert [f.value for f in figures_of(text)] == [0.912, 67000, 1078181, 1e-9, 0.5]
    assert figures_of("67 000")[0].is_rounded_from(67023)
    assert not figures_of("0.913")[0].is_rounded_from(0.9124)
