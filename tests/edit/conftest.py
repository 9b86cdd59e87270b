"""A served capture, and a browser that shows it."""

from __future__ import annotations

import pytest

from tests.edit.editors import tracked_once
from tests.edit.served import Served, write_capture
from tests.reporting.browser import Browser


@pytest.fixture(scope="module")
def browser():
    made = Browser()
    yield made
    made.close()


@pytest.fixture(autouse=True)
def _sessions():
    """Expected sessions of the capture are not tracked again in each test."""
    with tracked_once():
        yield


@pytest.fixture
def folder(tmp_path):
    """A folder with a capture."""
    write_capture(tmp_path)
    return tmp_path


@pytest.fixture
def served(folder):
    """A server of the capture."""
    made = Served(folder)
    yield made
    if made.process.poll() is None:
        assert made.stop() == (0, "")


@pytest.fixture
def by_method(folder):
    """A server of the capture tracked by one method, without the last assignment."""
    made = Served(folder, "--method", "gnn")
    yield made
    if made.process.poll() is None:
        assert made.stop() == (0, "")
