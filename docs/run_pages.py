"""Run the code of Markdown pages: ``python docs/run_pages.py PAGE.md…`` renews what they show.

The blocks of a page run in order, in one folder that is empty at first: Python in one namespace,
commands of the shell in between. A ``text`` block right after one shows what that one prints; a
line that is only … stands for any lines. Pictures of a page that its own code writes are those in
`docs/images`. The tests run the pages as they are and hold them to what they show.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

IMAGES = Path(__file__).parent / "images"
WIDTH = "95"  # columns that fit the page

_BLOCK = re.compile(r"^```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r"^!\[.*?\]\((?:\.\./)?images/(\S+\.png)\)", re.MULTILINE | re.DOTALL)
_SHELL = re.compile(r"[|><$;*&]")  # what only a shell understands


class PageError(Exception):
    """A block fails, or prints something else than the page shows."""


@dataclass(frozen=True, kw_only=True)
class Block:
    """A fenced block of a page.

    Parameters
    ----------
    language : str
        Behind the fence: python, sh or text.
    text : str
        What is in it.
    span : tuple of int
        Where `text` begins and ends in the page.
    line : int
        The line of the page on which `text` begins, from 1.
    """

    language: str
    text: str
    span: tuple[int, int]
    line: int


def blocks_of(source: str) -> list[Block]:
    """Give the fenced blocks of a page in order."""
    return [
        Block(
            language=m["language"],
            text=m["text"],
            span=m.span("text"),
            line=source.count("\n", 0, m.start("text")) + 1,
        )
        for m in _BLOCK.finditer(source)
    ]


def pictures_of(source: str) -> list[str]:
    """Give the names of the pictures in `docs/images` that a page shows."""
    return _PICTURE.findall(source)


def run(page: Path, folder: Path) -> list[tuple[Block, str, Block | None]]:
    """Run all blocks of a page in a folder.

    Returns
    -------
    list
        Each block that ran, what it printed, and the ``text`` block right after it, if any.

    Raises
    ------
    PageError
        If a block fails.
    """
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    namespace: dict[str, Any] = {"__name__": "__main__"}
    done: list[tuple[Block, str, Block | None]] = []
    with contextlib.chdir(folder), mock.patch.dict(os.environ, COLUMNS=WIDTH):
        for block, after in zip(blocks, [*blocks, None][1:], strict=True):
            shown = after if after is not None and after.language == "text" else None
            if block.language in ("python", "sh"):
                try:
                    is_python = block.language == "python"
                    out = _python(block, page, namespace) if is_python else _commands(block.text)
                except Exception as error:
                    where = f"{page.name}, line {block.line}"
                    raise PageError(f"{where}: {type(error).__name__}: {error}") from error
                done.append((block, out, shown))
    return done


def check(page: Path, folder: Path, *, draws: bool = True) -> None:
    """Run a page, and hold it to what it shows.

    Parameters
    ----------
    page, folder : Path
        Page, and an empty folder in which it runs.
    draws : bool
        Whether the page draws its pictures; otherwise another script does.

    Raises
    ------
    PageError
        If a block fails, prints something else than is shown, prints and nothing is shown
        (commands of the shell may), or if a picture of the page is not written by it.
    """
    source = page.read_text(encoding="utf-8")
    for block, out, shown in run(page, folder):
        expected = shown.text if shown is not None else "" if block.language == "python" else None
        if expected is not None and not is_as_shown(out, expected):
            lines = expected.splitlines(), _tidy(out).splitlines()
            difference = "\n".join(difflib.unified_diff(*lines, "shown", "printed", lineterm=""))
            hint = "if that is as it should be: python docs/run_pages.py " + page.name
            raise PageError(f"{page.name}, line {block.line}:\n{difference}\n({hint})")
    missing = [name for name in pictures_of(source) if not (folder / name).is_file()]
    if draws and missing:
        raise PageError(f"{page.name} shows {', '.join(missing)} and does not write it")


def is_as_shown(printed: str, shown: str) -> bool:
    """Whether a text is what is shown, where a line … stands for any lines, or for none."""
    parts = re.split(r"(?m)^…\n", _tidy(shown))
    return re.fullmatch(r"(?:.*\n)*?".join(map(re.escape, parts)), _tidy(printed)) is not None


def renew(page: Path) -> None:
    """Write what the blocks of a page print into it, and its pictures into `docs/images`.

    What is shown in part, with …, stays as it is.
    """
    from PIL import Image

    source = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for _, out, shown in reversed(run(page, folder)):
            if shown is not None and not re.search(r"(?m)^…$", shown.text):
                a, b = shown.span
                source = source[:a] + _tidy(out) + source[b:]
        for picture in pictures_of(source):
            if not (folder / picture).is_file():
                continue  # another script draws it
            # Few colours are enough, and a third of the bytes.
            small = Image.open(folder / picture).convert("RGB").quantize(128)
            small.save(IMAGES / picture, optimize=True)
    page.write_text(source, encoding="utf-8")


def _tidy(text: str) -> str:
    """Without blanks at the ends of lines and without empty lines around."""
    lines = "\n".join(line.rstrip() for line in text.splitlines()).strip("\n")
    return lines + "\n" if lines else ""


def _python(block: Block, page: Path, namespace: dict[str, Any]) -> str:
    # Lines are numbered as in the page, for tracebacks. The `annotations` of this file are not the
    # page's: with them a dataclass there would take a ClassVar for a field.
    text = "\n" * (block.line - 1) + block.text
    code = compile(text, str(page), "exec", dont_inherit=True)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(code, namespace)
    return out.getvalue()


def _commands(text: str) -> str:
    lines = text.replace("\\\n", " ").splitlines()
    commands = [words for line in lines if (words := shlex.split(line, comments=True))]
    if not _SHELL.search(text) and all(words[0] == "asterism" for words in commands):
        return "".join(_asterism(words[1:]) for words in commands)
    # Loops, pipes and the like: a shell, with the command of this environment.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    env = {**os.environ, "PATH": path, "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        ["sh", "-e", "-c", text], env=env, capture_output=True, encoding="utf-8", check=False
    )
    if done.returncode:
        raise PageError(f"exit code {done.returncode}: {done.stderr}")
    return done.stdout


def _asterism(arguments: list[str]) -> str:
    """Run a command in this process, which saves a second each."""
    from asterism.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    if code:
        raise PageError(f"asterism {shlex.join(arguments)}: exit code {code}: {err.getvalue()}")
    return out.getvalue()


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        renew(Path(argument).resolve())
