"""Tutorials, guides and workflows run, print what they show and draw their pictures."""

from __future__ import annotations

import importlib.util
import sys

import pytest

import asterism as am
from tests.paths import ROOT

DOCS = ROOT / "docs"
if not DOCS.is_dir():
    pytest.skip("the documentation is not in a source distribution", allow_module_level=True)
RUN = (
    *(f"guides/{name}" for name in ("track", "stitch", "fill", "large", "name")),
    *(f"guides/{name}" for name in ("confidence", "evaluate", "edit")),
    *(f"workflows/{name}" for name in ("opensim", "stream")),
)
PAGES = [
    DOCS / "start" / "first-capture.md",
    *sorted((DOCS / "tutorials").glob("*.md")),
    *(DOCS / f"{name}.md" for name in RUN),
]


def load(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = load("run_pages")


@pytest.fixture(autouse=True)
def lists_as_they_were():
    """Take back what a page adds to the lists of methods and formats."""
    before = [(entries, dict(entries)) for entries in (am.tracking.METHODS, am.io.CAPTURE_FORMATS)]
    yield
    for entries, old in before:
        entries.clear()
        entries.update(old)


@pytest.mark.parametrize("page", PAGES, ids=[p.stem for p in PAGES])
def test_a_page_prints_what_it_shows(page, tmp_path):
    # The pictures of the editor are screenshots: docs/make_edit_pictures.py.
    pages.check(page, tmp_path, draws=page.stem != "edit")


@pytest.mark.parametrize("page", PAGES, ids=[p.stem for p in PAGES])
def test_pictures_are_there_and_light(page):
    for name in pages.pictures_of(page.read_text(encoding="utf-8")):
        assert 0 < (pages.IMAGES / name).stat().st_size < 120_000


def test_every_page_is_in_the_navigation():
    navigation = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
    for page in DOCS.rglob("*.md"):
        if page.parent.name != "tables":
            assert f": {page.relative_to(DOCS).as_posix()}\n" in navigation


def test_every_example_is_listed():
    listed = (DOCS / "workflows" / "stream.md").read_text(encoding="utf-8")
    for example in (DOCS.parent / "examples").glob("*.py"):
        assert f"examples/{example.name}" in listed


def page_of(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text.replace("~~~", "```"), encoding="utf-8")
    return page


def test_blocks_share_a_namespace_and_the_folder(tmp_path):
    page = page_of(
        tmp_path,
        """
~~~python
import asterism as am
am.write(am.simulate.cube(frames=4), "in.csv")
n = 2
~~~
~~~sh
asterism info in.csv \\
    --json  # goes on
~~~
~~~python
print(n + 1)
~~~
~~~text
3
~~~
""",
    )
    pages.check(page, tmp_path)
    assert (tmp_path / "in.csv").is_file()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("~~~python\nprint(1)\n~~~\n~~~text\n2\n~~~\n", "line 2:\n--- shown"),
        ("~~~python\nprint(1)\n~~~\n", r"\+1"),  # what is printed must be shown
        ("\n~~~python\n1 / 0\n~~~\n", "line 3: ZeroDivisionError"),
        ("~~~sh\nasterism info nowhere.c3d\n~~~\n", "exit code 2: .*nowhere.c3d"),
        ("~~~sh\necho a | grep b\n~~~\n", "exit code 1"),
        ("~~~sh\necho a | cat\n~~~\n~~~text\nb\n~~~\n", r"-b\n\+a"),
        ("![one](images/missing.png)\n", "missing.png and does not write it"),
    ],
)
def test_mistakes_are_seen(tmp_path, text, why):
    with pytest.raises(pages.PageError, match=why):
        pages.check(page_of(tmp_path, text), tmp_path)


@pytest.mark.parametrize(
    ("printed", "shown", "fits"),
    [
        ("a\nb\n", "a\nb\n", True),
        ("a  \nb\n\n", "a\nb\n", True),
        ("a\nb\nc\nd\n", "a\n…\nd\n", True),
        ("a\nd\n", "a\n…\nd\n", True),
        ("a\nb\nc\n", "a\n…\nd\n", False),
        ("a\nb\n", "a\n", False),
        ("… a\n", "… a\n", True),
        ("b a\n", "… a\n", False),
    ],
)
def test_what_is_as_shown(printed, shown, fits):
    assert pages.is_as_shown(printed, shown) is fits


def test_renewing_writes_what_is_printed_and_keeps_what_is_shown_in_part(tmp_path):
    whole = "~~~python\nprint(1)\n~~~\n~~~text\n2\n~~~\n"
    part = "~~~sh\nprintf '%s\\n' a b\n~~~\n~~~text\na\n…\n~~~\n"
    text = whole + part
    page = page_of(tmp_path, text)
    pages.renew(page)
    assert page.read_text(encoding="utf-8") == text.replace("2", "1").replace("~~~", "```")
    pages.check(page, tmp_path)
