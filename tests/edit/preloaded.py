"""Import and track what the editors of the tests need, in the process that forks them."""

import uvicorn  # noqa: F401

from tests.edit.editors import track_for_commands

track_for_commands()
