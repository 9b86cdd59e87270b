"""The page of a person, and a browser that shows it."""

from __future__ import annotations

import pytest

from tests.reporting.browser import Browser
from tests.reporting.cases import full_page


@pytest.fixture(scope="module")
def browser():
    made = Browser()
    yield made
    made.close()


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    """The report page of a person, and what is on it."""
    return full_page(tmp_path_factory.mktemp("person") / "page.html")
