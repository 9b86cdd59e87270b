"""The reference in the docs has every public name."""

from __future__ import annotations

import inspect

import asterism as am
from tests.paths import ROOT

PAGES = ROOT / "docs" / "api"


def test_every_public_name_is_in_the_reference():
    shown = {
        line.removeprefix("::: ")
        for page in PAGES.glob("*.md")
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("::: ")
    }
    missing = []
    for name in am.__all__:
        thing = getattr(am, name)
        if inspect.ismodule(thing):  # or a function that a package of its name stands before
            thing = getattr(thing, name, None)
        home = getattr(thing, "__module__", "")
        if home.startswith("asterism.") and home not in shown:
            missing.append(f"{name} of {home}")
    assert not missing
