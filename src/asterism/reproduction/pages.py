"""The files of a reproduction: figures and a piece of Markdown for each part, and the pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.io.atomic import replacing, write_text
from asterism.plot import figure_bytes
from asterism.reproduction import html, markdown

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from asterism.reproduction.part import Effort, Made

__all__ = ["HTML", "MARKDOWN", "TIMES", "write_pages", "write_part"]

HTML, MARKDOWN, TIMES = "reproduction.html", "reproduction.md", "times.md"
PARTS, IMAGES = "parts", "images"


def write_part(made: Made, out: Path) -> None:
    """Write the figures of a part and its piece of Markdown."""
    for folder in (PARTS, IMAGES):
        (out / folder).mkdir(exist_ok=True)
    for picture in made.outcome.pictures:
        for ending in ("svg", "pdf"):
            with replacing(out / IMAGES / f"{picture.name}.{ending}") as file:
                file.write(figure_bytes(picture.figure, ending))
    write_text(out / PARTS / f"{made.name}.md", markdown.part_text(made, IMAGES))


def write_pages(done: Sequence[Made], missing: Sequence[str], effort: Effort, out: Path) -> None:
    """Write the pages of all parts that are finished.

    Parameters
    ----------
    done : sequence of Made
        The parts; their figures are written already.
    missing : sequence of str
        Names of the parts that were asked for and not made.
    effort : Effort
        With what they were made.
    out : Path
        The folder.
    """
    pictures = {
        picture.name: (out / IMAGES / f"{picture.name}.svg").read_text(encoding="utf-8")
        for made in done
        for picture in made.outcome.pictures
    }
    write_text(out / PARTS / "contents.md", markdown.contents_text(done))
    write_text(out / PARTS / "rules.md", markdown.rules_text() + "\n")
    write_text(out / MARKDOWN, markdown.page_text(done, missing, effort, IMAGES))
    write_text(out / HTML, html.page_text(done, missing, effort, pictures))
    write_text(out / TIMES, markdown.times_text(done))
